"""One point of a design: tow radius, speed and length of cable, and the state flown there."""

from dataclasses import dataclass, replace
from math import exp, inf, isfinite, log1p, nan

from ctcbs_ros.scaling import FlightPoint
from ctcbs_ros.solver.branches import branch_end
from ctcbs_ros.solver.family import ANGULAR_RATE, RADIUS_AT_SPEED, Family
from ctcbs_ros.solver.flown import branch_from_straight_flight, match
from ctcbs_ros.solver.stability import Stability, stability
from ctcbs_ros.solver.steady_state import SteadyState, steady_states


@dataclass(frozen=True)
class DesignPoint:
    """A point and the state flown there, in SI units.

    Attributes
    ----------
    flight : FlightPoint
    solutions : int
        Number of steady states.
    state : SteadyState or None
        The one flown; None where there is none.
    damping : Stability or None
        Of the state flown.
    jump_in_speed, jump_in_radius : float
        Speed [m/s] at this radius, and radius [m] at this speed, that end the branch: the nearest;
        nan where there is none in the reach looked over.
    reason : str
        Why states are missing, if any are.
    """

    flight: FlightPoint
    solutions: int
    state: SteadyState | None
    damping: Stability | None
    jump_in_speed: float = nan
    jump_in_radius: float = nan
    reason: str = ""

    @property
    def end_mass_radius(self) -> float:
        """[m]; nan without a state."""
        return nan if self.state is None else self.state.end_mass_radius * self.flight.radius

    @property
    def end_mass_radius_share(self) -> float:
        """Over the tow radius."""
        return nan if self.state is None else self.state.end_mass_radius

    @property
    def depth(self) -> float:
        """Of the end mass below the tow point [m]."""
        return nan if self.state is None else self.state.depth * self.flight.radius

    @property
    def tension(self) -> float:
        """The greatest along the cable [N]; nan without a state."""
        if self.state is None:
            return nan
        return self.state.greatest_tension * self.flight.tension_unit

    @property
    def margin(self) -> float:
        """Decay rate of the least damped mode [1/s]; negative is unstable."""
        return nan if self.damping is None else self.damping.margin * self.flight.angular_rate

    @property
    def nearest_jump(self) -> float:
        """Relative change of speed or radius that ends the branch, the smaller; inf for none."""
        changes = (
            self.jump_in_speed / self.flight.speed - 1.0,
            self.jump_in_radius / self.flight.radius - 1.0,
        )
        return min((c for c in changes if isfinite(c)), key=abs, default=inf)

    @property
    def stable(self) -> bool:
        """Whether small disturbances of the state flown decay."""
        return self.damping is not None and self.damping.stable


def design_point(flight: FlightPoint, jump_reach: float = 0.0) -> DesignPoint:
    """All steady states of a point, and the one flown after tightening from straight flight.

    Parameters
    ----------
    flight : FlightPoint
    jump_reach : float
        Relative change of speed and of radius over which a jump is looked for; 0 for none.

    Returns
    -------
    DesignPoint
    """
    found = steady_states(flight.parameters)
    state = flown_state(flight, found.states)
    point = point_of(flight, found, state)
    if state is None or not jump_reach > 0.0:
        return point
    return replace(
        point,
        jump_in_speed=flight.speed * _nearest_jump(state, ANGULAR_RATE, jump_reach),
        jump_in_radius=flight.radius * _nearest_jump(state, RADIUS_AT_SPEED, jump_reach),
    )


def point_of(flight: FlightPoint, found, state: SteadyState | None) -> DesignPoint:
    """The point of a state known to be flown, among all that were found (`SteadyStates`)."""
    damping = None if state is None else stability(state)
    return DesignPoint(flight, len(found.states), state, damping, reason=found.reason)


def flown_state(flight: FlightPoint, states) -> SteadyState | None:
    """The state met by tightening from straight flight at this speed and length of cable.

    Where that leads to no stable state: the one of least radius that does not diverge.
    """
    if len(states) <= 1:
        return states[0] if states else None
    chosen = match(states, branch_from_straight_flight(flight.parameters).end_mass_radius)
    if chosen is None:
        chosen = next((i for i, state in enumerate(states) if state.slope > 0.0), 0)
    return states[chosen]


def _nearest_jump(state: SteadyState, family: Family, reach: float) -> float:
    """Where the branch ends within a reach, over the present value; nan if it does not."""
    places = []
    for direction, distance in ((-1, -log1p(-min(reach, 0.9))), (1, log1p(reach))):
        fold = branch_end(state, family, direction, distance)
        # A trace may end a little beyond what was asked.
        if fold is not None and abs(fold.tau) <= distance:
            places.append(exp(fold.tau))
    return min(places, key=lambda place: abs(place - 1.0), default=nan)
