"""`ctcbs steady --config` says where the point leaves the envelope and a state breaks a limit."""

import json

import pytest
import yaml
from folding_flight import folding_mapping

from ctcbs_ros.cli.main import main


@pytest.fixture
def file(tmp_path):
    def written(configuration):
        path = tmp_path / "configuration.yaml"
        path.write_text(yaml.safe_dump({"/**": {"ros__parameters": configuration}}))
        return str(path)

    return written


def steady(capsys, *arguments):
    assert main(["steady", "--config", *arguments]) == 0
    return capsys.readouterr().out


def codes(warnings):
    return [warning["code"] for warning in warnings]


def test_a_point_within_all_that_the_configuration_sets_is_said_to_be_so(capsys):
    text = steady(capsys, "small_drone", "--radius=60", "--speed=20")
    assert "within envelope and limits of" in text
    assert "height above the ground not judged" in text


def test_a_point_outside_the_envelope_is_told_by_each_quantity(capsys):
    text = steady(capsys, "small_drone", "--radius=125", "--speed=29")
    assert "OUTSIDE_ENVELOPE: tow radius 125.0 m is outside 40 to 120 m" in text
    assert "OUTSIDE_ENVELOPE: speed 29.0 m/s is outside 12 to 28 m/s" in text
    assert "within" not in text


def test_the_limits_that_a_state_breaks_are_told_with_it(capsys, file):
    configuration = folding_mapping()
    configuration["limits"] = {"low_margin_per_s": 0.9, "near_jump": 0.1}
    configuration["cable"]["breaking_tension"] = 500.0
    point = [file(configuration), "--radius=100", "--speed=33"]
    result = json.loads(steady(capsys, *point, "--json"))
    assert result["warnings"] == []
    assert len(result["solutions"]) == 3  # thesis Fig. 3.1, d_n 4.8, omega 1.05
    for number, solution in enumerate(result["solutions"]):
        told = codes(solution["warnings"])
        assert told[0] == ("UNSTABLE" if number == 1 else "LOW_MARGIN")
        above = solution["si"]["greatest_tension_n"] > 250.0
        assert ("TENSION_LIMIT" in told) is above
    # There is a fold at the tow radius told: states come or go there.
    (jump,) = [
        w["text"] for w in result["solutions"][2]["warnings"] if w["code"] == "NEAR_JUMP"
    ]
    at = float(jump.split("tow radius of ")[1].split(" ")[0])
    beside = [
        len(json.loads(steady(capsys, point[0], f"--radius={at * k}", "--speed=33", "--json"))[
            "solutions"
        ])
        for k in (0.995, 1.005)
    ]  # fmt: skip
    assert sorted(beside) == [1, 3]
    text = steady(capsys, *point)
    assert f"NEAR_JUMP: {jump} (the state at " in text


def test_the_height_is_judged_where_it_and_the_grounds_are_known(capsys, file):
    configuration = folding_mapping()
    configuration["air"] = {"model": "standard_atmosphere"}
    configuration["ground"] = {"level_amsl": 100.0}
    point = [file(configuration), "--radius=100", "--speed=37"]
    for altitude, near in (("350", True), ("900", False)):
        text = steady(capsys, *point, "--altitude", altitude)
        assert ("GROUND_PROXIMITY: end mass" in text) is near
        assert "not judged" not in text
