"""The tables of docs/orbit.md, made of what `ctcbs orbit-study --json` prints."""

import math

from ctcbs_ros.orbit import study_cases
from ctcbs_ros.orbit.study import most_taken


def tables(report):
    """Tables by title, each a list of lines of Markdown."""
    return {
        "noise": accuracy(report["accuracy"]),
        "turns": turns(report["entry_and_departure"]),
        "track": tracks(report["taken_for_orbits"]),
        "change": convergence(report["convergence"]),
        "methods": methods(report["comparison"]),
    }


def accuracy(rows):
    lines = [
        "| noise | flights | radius | bias | centre | circle | rate | phase | no orbit |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        noise, covered = study_cases.NOISES[row["noise"]], row["covered"]
        center = row["center"]
        known = center is not None and math.isfinite(center)
        inside = [
            f"{100.0 * covered[what]:.1f} %" if what in covered else "-"
            for what in ("circle", "rate", "phase")
        ]
        cells = [
            row["noise"], str(row["runs"]),
            f"{100.0 * row['radius']:.2f} % ({100.0 * noise.most_radius:g})",
            f"{100.0 * row['radius_bias']:+.2f} %",
            (f"{center:.2f} m" if known else "-")
            + (f" ({noise.most_center:g})" if math.isfinite(noise.most_center) else ""),
            *inside, str(row["lost"]),
        ]  # fmt: skip
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def turns(found):
    lines = ["| turns | median | 95 % | most |", "|---|---|---|---|"]
    for name, values in (
        ("from entry to the first orbit", found["first"]),
        ("from departure to none", found["left"]),
    ):
        lines.append(f"| {name} | " + " | ".join(f"{v:.2f}" for v in values) + " |")
    return lines


def tracks(rows):
    lines = ["| track that is no orbit | taken for one | bar |", "|---|---|---|"]
    for row in rows:
        name = row["track"]
        lines.append(
            f"| {name} | {100.0 * row['share']:.1f} % | {100.0 * most_taken(name):g} % |"
        )
    return lines


def convergence(rows):
    lines = [
        "| change | radius in its 95 % | circle in its 95 % | samples with an orbit | "
        "0.3 to 0.6 turns after: circle | with an orbit | true is the circle settled upon alone |",
        "|---|---|---|---|---|---|---|",
    ]
    keys = "interval", "covered", "stated", "early", "early_stated", "settled"
    for row in rows:
        cells = [
            "-" if row[key] is None or math.isnan(row[key]) else f"{100.0 * row[key]:.1f} %"
            for key in keys
        ]
        lines.append(f"| {row['change']} | " + " | ".join(cells) + " |")
    return lines


def methods(rows):
    cases = list(dict.fromkeys(row["case"] for row in rows))
    lines = [
        "| radius error, root mean square (largest) | " + " | ".join(cases) + " |",
        "|---|" + "---|" * len(cases),
    ]
    for method in dict.fromkeys(row["method"] for row in rows):
        found = {row["case"]: row for row in rows if row["method"] == method}
        cells = [f"{percent(found[c]['radius'])} ({percent(found[c]['worst'])})" for c in cases]
        lines.append(f"| {method} | " + " | ".join(cells) + " |")
    return lines


def percent(share):
    """Two digits; what is more than the circle itself is no figure."""
    return f"{100.0 * share:.2f} %" if share < 1.0 else "> 100 %"


def sentence(report):
    """What the tables of docs/orbit.md do not tell."""
    rows = {row["noise"]: row for row in report["accuracy"]}
    drift = rows["drift 5 m/s with the air, 1.3 turns"]["drift"]
    runs = report["entry_and_departure"]["runs"]
    return f"The error of the drift is {drift:.2f} m/s. Entry and departure, of {runs} flights:"


def readme(report):
    """What README.md says of the orbit."""
    rows = {row["noise"]: row for row in report["accuracy"]}
    white = rows["white 1.5 m, 0.3 m/s"]
    rough = rows["white 5 m, 1 m/s, 20 % lost"]
    slow = rows["Gauss-Markov 2 m, 45 s on 0.5 m, 0.3 m/s"]
    inside = ", ".join(f"{100.0 * row['covered']['circle']:.1f}" for row in (white, rough, slow))
    turns = report["entry_and_departure"]
    return (
        f"radius to {100.0 * white['radius']:.2f} % and centre to {white['center']:.2f} m at "
        f"1.5 m noise, {100.0 * rough['radius']:.2f} % and {rough['center']:.2f} m at 5 m with "
        f"20 % lost, {100.0 * slow['radius']:.2f} % and {slow['center']:.2f} m where 2 m are "
        f"correlated over 45 s; {inside} % of {white['runs']} circles inside the stated 95 % "
        f"(the rate, at 1.5 m, {100.0 * white['covered']['rate']:.1f} %); "
        f"first orbit {turns['first'][1]:.2f} turns after the entry, none "
        f"{turns['left'][2]:.2f} turns after the exit"
    )
