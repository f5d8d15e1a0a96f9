"""The page over a batch: every file, every reason once, who is far off, links that lead somewhere."""

import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from forceid.files import write_result
from forceid.report.batch_page import causes, render_batch
from forceid.report.outliers import FEW_FILES, find_outliers


def record(k, status="ok", **more):
    verdict = {"status": status, "file": f"in/m{k:02d}.h5", "output": f"out/m{k:02d}.result.h5"}
    if status == "failed":
        error = f"in/m{k:02d}.h5 is cut short at byte {k}; copy it again"
        return {**verdict, "error": error, "error_cause": "DataError copy it again", **more}
    known = {"verdict": "ok" if status == "skipped" else status, "nis_mean": 1 + 0.01 * k}
    size = {"force_rms": [1.0, 2.0, 3.0], "force_std": [0.1, 0.1, 0.1], "moment_rms": [None] * 3}
    return {**verdict, **known, **size, "moment_std": [None] * 3, "runtime_s": 0.5, "samples": 40, **more}


def said(code, text, **values):
    return {"reasons": [text], "reason_codes": [code], "reason_values": [values]}


BATCH = [
    *(record(k) for k in range(10)),
    record(10, "degraded", **said("noise", "noise is 3.0 times that stated"), nis_mean=9.0),
    record(11, "degraded", **said("noise", "noise is 2.5 times that stated")),
    record(
        12, "refused", **said("on-line", "the markers lie on a <line>"), nis_mean=None, force_rms=[None] * 3
    ),
    record(13, "skipped"),
    record(14, "failed"),
    record(15, "failed"),
]


class Links(HTMLParser):
    def __init__(self, page):
        super().__init__()
        self.links, self.images, self.names = [], [], []
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        found = dict(attrs)
        if tag == "a":
            self.links.append(found["href"])
            self.names.append(found["aria-label"])
        if tag == "img":
            self.images.append(found)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("batch") / "out"
    made.mkdir()
    (made / "m03.result.html").write_text("a report")
    return made


@pytest.fixture(scope="module")
def page(folder):
    batch = [{**r, "output": str(folder / r["output"].removeprefix("out/"))} for r in BATCH]
    return render_batch(batch, folder)


def test_worst_files_come_first_and_every_file_once(page):
    rows = re.findall(r'<tr class="(\w+)"><th scope="row">in/(m\d\d)\.h5', page)
    assert sorted(name for _, name in rows) == [f"m{k:02d}" for k in range(16)]
    assert [level for level, _ in rows] == ["failed"] * 2 + ["refused"] + ["degraded"] * 2 + ["ok"] * 11
    assert "ok, kept" in page
    assert "Some files have no result." in page


def test_links_lead_to_results_and_reports_and_to_no_host(page):
    seen = Links(page)
    assert sorted(link for link in seen.links if link.endswith(".h5")) == [
        f"m{k:02d}.result.h5" for k in range(14)
    ]
    assert [link for link in seen.links if link.endswith(".html")] == ["m03.result.html"]
    assert len(set(seen.names)) == len(seen.names)
    assert "://" not in page
    assert all(image["alt"] and image["src"].startswith("data:image/png") for image in seen.images)
    assert len(seen.images) == 1


def test_one_reason_in_two_wordings_is_one_cause():
    found = causes(BATCH)
    assert [(cause.level, len(cause.files)) for cause in found] == [
        ("failed", 2), ("refused", 1), ("degraded", 2),
    ]  # fmt: skip
    assert found[0].text == "m14.h5 is cut short at byte 14; copy it again"
    assert found[2].files == ("m10.h5", "m11.h5")


def test_one_finding_on_two_things_is_two_causes():
    both = [said("joint-apart", f"apart at {name}", joint=name, off_mm=3.0) for name in ("hip", "knee")]
    found = causes([record(k, "degraded", interface={"verdict": "degraded"} | both[k % 2]) for k in range(4)])
    assert [(cause.text, cause.files) for cause in found] == [
        ("joints: apart at hip", ("m00.h5", "m02.h5")), ("joints: apart at knee", ("m01.h5", "m03.h5")),
    ]  # fmt: skip


def test_what_a_file_says_is_shown_as_text(page):
    assert "the markers lie on a &lt;line&gt;" in page


def test_a_file_far_from_the_others_is_named_with_number_and_median(page):
    assert "m10.h5: NIS 9 where the median is 1.06" in page


def test_an_interrupted_batch_says_how_many_files_are_left(folder):
    said = render_batch(BATCH[:2], folder, undone=5)
    assert "Batch of 7 files" in said
    assert "5 files were not reached" in said
    assert "No file was done." in render_batch([], folder, undone=1)


def test_names_with_odd_letters_make_links_that_work(tmp_path):
    odd = record(0, output=str(tmp_path / "a b#1%.result.h5"))
    assert Links(render_batch([odd], tmp_path)).links == ["a%20b%231%25.result.h5"]


@pytest.mark.parametrize("spread", [0.0, 0.02, 0.3])
def test_nobody_stands_out_by_chance(spread):
    rng = np.random.default_rng(0)
    values = np.exp(spread * rng.standard_normal(200).clip(-3, 3))
    assert find_outliers([{"file": str(k), "nis_mean": v} for k, v in enumerate(values)]) == []


def test_few_files_have_no_outlier_and_odd_ones_do_not_hide_each_other():
    few = [{"file": str(k), "nis_mean": 1.0} for k in range(FEW_FILES - 2)]
    assert find_outliers([*few, {"file": "odd", "nis_mean": 100.0}]) == []
    many = [{"file": str(k), "nis_mean": 1.0} for k in range(12)]
    odd = [{"file": f"odd{k}", "nis_mean": v} for k, v in enumerate((100.0, 80.0, 0.01, 90.0))]
    assert {o.file for o in find_outliers([*many, *odd])} == {"odd0", "odd1", "odd2", "odd3"}


def test_small_multiples_show_every_result_to_one_scale(throw, tmp_path):
    for k, size in enumerate((1.0, 1.0, 1.0, 0.5)):
        estimate, _ = throw(400)
        loud = replace(estimate, force=size * estimate.force, deformation=np.zeros((400, 0, 3)), node=())
        write_result(tmp_path / f"m{k:02d}.result.h5", replace(loud, mean_shape=np.zeros((0, 3))))
    batch = [{**record(k), "output": str(tmp_path / f"m{k:02d}.result.h5")} for k in range(5)]
    page = render_batch(batch, tmp_path)
    small = page[page.index('<ul class="small">') :]
    assert re.findall(r'<li class="ok">(m\d\d)', small) == ["m00", "m01", "m02", "m03"]
    curves = [re.findall(r"[\d.]+ ([\d.]+)", d) for d in re.findall(r'var\(--z\)" d="([^"]*)"', small)]
    heights = [max(20 - float(y) for y in d) for d in curves[::2]]  # of every force
    assert heights[0] == pytest.approx(18, abs=0.1)
    assert heights[3] == pytest.approx(9, abs=0.1)
