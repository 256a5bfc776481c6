"""What is said of a design: as JSON, as text, in its report, and by the exit code."""

import base64
import io
import json
import os
import shlex
from dataclasses import replace
from html.parser import HTMLParser
from math import nan

import pytest
from matplotlib.image import imread

from ctcbs_ros import __version__
from ctcbs_ros.cli.main import main
from ctcbs_ros.cli.output import print_json
from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.design.changes import changed
from ctcbs_ros.design.chart import chart_column
from ctcbs_ros.design.design import Design, cautions
from ctcbs_ros.design.evaluation import Grid, evaluate
from ctcbs_ros.design.limits import limits
from ctcbs_ros.design.radii import good_radii
from ctcbs_ros.design.record import design_record
from ctcbs_ros.design.remedies import Remedy, find_remedies
from ctcbs_ros.design.report import report, write_report
from ctcbs_ros.design.report_plots import envelope_plot, way_in_plot
from ctcbs_ros.design.requirements import Requirements
from ctcbs_ros.design.text import design_text, vain_text
from ctcbs_ros.design.way_in import DEPLOYMENT, ENTRY
from ctcbs_ros.errors import InputError

WEAK = ("cable.breaking_tension=30", "envelope.radius=[90, 120]", "envelope.speed=[20, 28]")
SMALL = Grid(radii=2, speeds=2, deployed_radii=2, deployed_speeds=2, steps=6)


@pytest.fixture(scope="module")
def weak():
    """The small drone on a cable too weak by a safety factor of 5, under a name that is markup."""
    one = replace(load_configuration("small_drone", WEAK), source="a/<script>&\"'.yaml")
    evaluation = evaluate(one, 1.225, Requirements(tension=0.2), SMALL)
    chart = (chart_column(one, 1.225, 120.0),)
    return Design(
        evaluation, limits(evaluation), cautions(evaluation, chart), chart,
        {28.0: good_radii(evaluation, 28.0)}, tuple(find_remedies(evaluation, SMALL)),
    )  # fmt: skip


@pytest.fixture(scope="module")
def mended(weak):
    """The same with the cable that the remedy asks for."""
    remedy = next(r for r in weak.remedies if r.change == "stronger cable")
    configuration = changed(weak.evaluation.configuration, remedy.settings)
    evaluation = evaluate(configuration, 1.225, Requirements(tension=0.2), SMALL)
    return replace(weak, evaluation=evaluation, limits=limits(evaluation), remedies=())


def test_json_has_every_point_with_units_and_the_verdict(weak, capsys):
    print_json(design_record(weak))
    result = json.loads(capsys.readouterr().out)
    assert result["verdict"] == "NOT OK"
    assert "TENSION_LIMIT" in result["text"]
    assert result["envelope_radius_m"] == [90.0, 120.0]
    assert result["requirements"]["tension_share"] == 0.2
    assert result["cable"]["breaking_tension"] == 30.0
    one = result["points"][0]
    for name in (
        "radius_m", "speed_m_s", "cable_length_m", "end_mass_radius_m", "depth_m",
        "tension_tow_point_n", "tension_end_mass_n", "margin_per_s", "growth_rate_per_s",
    ):  # fmt: skip
        assert isinstance(one[name], float), name
    assert (one["radius_m"], one["speed_m_s"], one["cable_length_m"]) == (90.0, 20.0, 150.0)
    assert one["solutions"] == 1
    assert one["stable"] is True
    assert one["margin_per_s"] == -one["growth_rate_per_s"]
    lengths = [point["cable_length_m"] for point in result["deployments"][0]["points"]]
    assert lengths == sorted(lengths)
    assert lengths[-1] == 150.0
    worst = max(
        p["greatest_tension_n"]
        for part in (result["points"], *(way["points"] for way in result["deployments"]))
        for p in part
    )
    bad = [limit for limit in result["limits"] if not limit["good"]]
    assert {limit["criterion"] for limit in bad} == {"TENSION_LIMIT"}
    assert all(limit["limit"] == pytest.approx(6.0) for limit in bad)
    assert max(limit["value"] for limit in bad) == worst
    remedy = next(x for x in result["remedies"] if x["change"] == "stronger cable")
    assert remedy["found"]
    assert remedy["value"] == pytest.approx(5.0 * worst, rel=0.01)
    assert remedy["value"] >= 5.0 * worst


def test_text_begins_with_the_verdict_and_gives_each_remedy_as_an_option(weak):
    first, *rest = design_text(weak).splitlines()
    assert first.startswith("NOT OK: TENSION_LIMIT: tension ")
    assert "of 6 N allowed" in first
    stronger = next(line for line in rest if "stronger cable" in line)
    assert "at least" in stronger
    word, option = stronger.split()[-2:]
    assert word == "--set"
    remedy = next(r for r in weak.remedies if r.change == "stronger cable")
    again = load_configuration("small_drone", [option, *WEAK[1:]])
    assert again.cable.breaking_tension == remedy.value
    narrower = next(line for line in rest if "smaller largest radius" in line)
    if "--set" in narrower:
        _, setting = shlex.split(narrower)[-2:]
        assert load_configuration("small_drone", [setting]).envelope.radius[0] == 90.0


def test_text_of_a_good_design_says_how_much_of_its_nearest_limit_is_used(mended):
    text = design_text(mended)
    assert text.startswith("OK: one stable steady state at all ")
    assert "nearest limit used to 99 %: tension" in text or "used to 100 %: tension" in text
    assert "Remedies" not in text


class Page(HTMLParser):
    """Text, images and unclosed tags of a page; an AssertionError where tags do not nest."""

    def __init__(self, text):
        super().__init__()
        self.open, self.text, self.images = [], "", []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attributes):
        if tag == "img":
            self.images.append(dict(attributes))
        elif tag != "meta":
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


def test_report_is_one_valid_page_that_needs_nothing_else(tmp_path, weak):
    file = tmp_path / "report.html"
    write_report(file, weak)
    raw = file.read_text(encoding="utf-8")
    page = Page(raw)
    assert page.open == []
    assert "<script" not in raw
    assert "http" not in raw
    assert len(page.images) == 2
    for image in page.images:
        assert image["alt"]
        data = image["src"].removeprefix("data:image/png;base64,")
        assert base64.b64decode(data, validate=True).startswith(b"\x89PNG")
    for words in (
        "Design of <script>&\"'.yaml", "NOT OK: TENSION_LIMIT", "stronger cable", "still air",
        "cable length l", "28 m/s: 90 to 120 m", __version__,
    ):  # fmt: skip
        assert words.lower() in page.text.lower(), words


@pytest.mark.parametrize("straight", [False, True])
def test_nothing_in_a_picture_is_cut_at_its_edge(weak, straight):
    requirements = replace(weak.evaluation.requirements, way_in=ENTRY if straight else DEPLOYMENT)
    design = replace(weak, evaluation=replace(weak.evaluation, requirements=requirements))
    for picture in (envelope_plot(design), way_in_plot(design)):
        pixels = imread(io.BytesIO(picture))
        for edge in (pixels[:5], pixels[-5:], pixels[:, :5], pixels[:, -5:]):
            assert (edge == 1.0).all()


def test_what_was_tried_in_vain_is_told_with_its_quantity_and_range():
    vain = Remedy("faster flight", nan, 12.0, 24.0, nan, {}, ("END_MASS_RADIUS",))
    assert vain_text(vain) == (
        "faster flight: least speed tried from 12 m/s up to 24 m/s, not enough alone; "
        "END_MASS_RADIUS still stands there"
    )


def test_report_of_a_good_design_names_no_remedy(mended):
    page = Page(report(mended))
    assert "OK: one stable steady state" in page.text
    assert "What to change" not in page.text


def test_a_report_that_fails_half_way_leaves_the_old_one(tmp_path, weak, monkeypatch):
    file = tmp_path / "report.html"
    file.write_text("old")

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(InputError, match="cannot be written"):
        write_report(file, weak)
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]
    assert file.read_text() == "old"


@pytest.mark.parametrize(("asked", "good", "code"), [
    ([], False, 0), (["--exit-code"], False, 1), (["--exit-code"], True, 0),
])  # fmt: skip
def test_a_verdict_is_a_result_unless_it_is_asked_for_as_the_exit_code(
    asked, good, code, weak, mended, monkeypatch, capsys
):
    design = mended if good else weak
    monkeypatch.setattr("ctcbs_ros.design.design.carry_out", lambda *_, **__: design)
    assert main(["design", "small_drone", *asked]) == code
    assert capsys.readouterr().out.startswith("OK" if good else "NOT OK")
