"""Systems over a recording: what they are given, what becomes of what they do."""

from __future__ import annotations

import csv
import json
import shutil
import sys
import textwrap
from dataclasses import replace

import pytest

from terrain_forge.base import DataError, OutputError
from terrain_forge.building import holding
from terrain_forge.datasets import FORMATS, open_recording, state_of, write_dataset
from terrain_forge.evaluation import (
    ScoreOptions,
    chosen_systems,
    evaluate_recording,
    find_system,
    result_lines,
)
from terrain_forge.evaluation.catalogue import with_binaries
from terrain_forge.evaluation.needs import sensor_places
from tests.helpers import command_line
from tests.helpers.recordings import write_recording

_NOISY = """
    lines = [l.split() for l in open(f"{source}/truth/cam0.tum") if l[0] != "#"]
    with open(target, "w") as file:
        for n, (t, x, *rest) in enumerate(lines):
            file.write(" ".join([t, str(float(x) + (-1) ** n * 0.01), *rest]) + "\\n")
"""
"""Copies the truth with an error of 1 cm to and fro."""
_KITTI = """
    import shutil
    shutil.copy(f"{source}/poses/00.txt", target)
"""
_SHORT = """
    lines = open(f"{source}/poses/00.txt").readlines()
    open(target, "w").writelines(lines[:-1])
"""


@pytest.fixture
def system(tmp_path):
    """Writes a system as whoever brings one does: a program, and a YAML file."""

    def write(name, body, **keys):
        program = tmp_path / f"{name}.py"
        program.write_text("import sys\nsource, target = sys.argv[1:]\n" + textwrap.dedent(body))
        told = {"command": f"{sys.executable} {program} {{input}} {{output}}", "frame": "cam0"}
        (tmp_path / f"{name}.yaml").write_text(json.dumps({**told, **keys}))  # JSON is YAML
        return str(tmp_path / f"{name}.yaml")

    return write


@pytest.mark.parametrize(
    ("keys", "why"),
    [
        ({"input": "vhs"}, "unknown dataset format 'vhs'"),
        ({"input": "kitti", "input_options": {"scan": True}}, "unknown key 'scan'"),
        ({"command": "run {inputs}"}, "command has {inputs}, known: {input}"),
        ({"command": "run '"}, "command: no closing quotation"),
        ({"output": "{folders}/a.tum"}, "output has {folders}, known: {input}"),
        ({"stamps": "{here}"}, "stamps has {here}, known"),
        ({"frame": "{folder}"}, "frame has {folder}, known: {left}, {right}, {lidar}"),
        ({"map": "{there}.ply"}, "map has {there}, known: {input}"),
        ({"frame": "nolink"}, "wrong: frame: no sensor 'nolink' was recorded, there are: cam0 ("),
    ],
)
def test_a_mistake_of_a_system_is_refused_before_any_runs(keys, why, dataset, system):
    names = system("good", _SHORT), system("wrong", "", **keys)
    before = sorted((dataset / "slam").glob("*"))
    done = command_line.run("evaluate", dataset, "--systems", ",".join(names))
    assert (done.returncode, len(done.complaints)) == (2, 1)
    assert why in done.complaints[0]
    assert sorted((dataset / "slam").glob("*")) == before


def test_each_goes_its_way_and_the_others_go_on(dataset, system, tmp_path):
    names = [
        system("noisy", _NOISY, needs=["stereo"]),
        system("missing", "", command="/nowhere/orb {input}"),
        system("silent", "print('no ground')"),
        system("kitti", _KITTI, input="kitti", format="kitti"),
        system("halted", _SHORT, input="kitti", format="kitti"),
        system("tactile", "", needs=["odometry"]),
        system("orb", "", command="{binary} {input}"),
    ]
    options = "--systems", ",".join(names), "--set", "align=origin", "-o", tmp_path / "o"
    done = command_line.run("evaluate", dataset, *options)
    assert done.returncode == 0, done.stderr
    told = json.loads((dataset / "slam" / "evaluation.json").read_text())
    found = {one["system"]: (one["status"], one["why"]) for one in told}
    assert found == {
        "noisy": ("done", ""),
        "missing": ("failed", "/nowhere/orb: no such file or directory"),
        "silent": ("lost", "wrote no trajectory (silent.tum)"),
        "kitti": ("done", ""),
        "halted": (
            "lost",
            "halted: 4 poses of 5 frames, and KITTI's format has no times to tell of which: name a "
            "file of them as `stamps` of the system",
        ),
        "tactile": ("failed", "tactile needs odometry, which was not recorded"),
        "orb": ("failed", "orb is a program of yours: --binary orb=PATH"),
    }
    printed = [line for line in done.stdout.splitlines() if "what it printed" in line]
    assert printed == [f"silent: what it printed: {dataset / 'slam' / 'silent_1' / 'output.txt'}"]
    scores = {one["system"]: one["score"] for one in told if one["score"]}
    assert scores["kitti"]["ate_m"]["rms"] < 1e-9
    assert scores["noisy"]["ate_m"]["rms"] == pytest.approx(0.02 * 0.4**0.5, rel=1e-6)  # 2 of 5
    assert (dataset / "slam" / "noisy_1" / "noisy.tum").is_file()
    with (tmp_path / "o" / "evaluation.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["system"] for row in rows] == list(found)
    assert rows[0]["tracked [%]"] == "100"
    assert float(rows[0]["processor [s/frame]"]) > 0 < float(rows[0]["memory [MB]"])
    assert rows[2]["result"].startswith("lost: wrote no")
    for ending in ("tex", "txt"):
        assert "noisy" in (tmp_path / "o" / f"evaluation.{ending}").read_text()


_SOME = """
    lines = open(f"{source}/poses/00.txt").readlines()
    kept = [1, 2, 4]
    open(target, "w").writelines(lines[n] for n in kept)
    times = open(f"{source}/sequences/00/times.txt").read().split()
    open("frames.txt", "w").writelines(f"{n}\\n" for n in kept)
    open("times.txt", "w").writelines(f"{times[n]}\\n" for n in kept)
    open("few.txt", "w").write("1\\n2\\n")
    open("wrong.txt", "w").write("1\\n2\\n9\\n")
"""
"""Tells three of five poses, and which they are."""


def test_kittis_format_needs_no_pose_of_each_frame_where_stamps_are_told(dataset, system):
    kinds = {"times": "seconds", "frames": "frames", "few": "frames", "wrong": "frames",
             "none": "frames"}  # fmt: skip
    adapters = [
        find_system(system(name, _SOME, input="kitti", format="kitti", stamps=f"{name}.txt",
                           stamps_in=kind))
        for name, kind in kinds.items()
    ]  # fmt: skip
    results = evaluate_recording(dataset, adapters, options=ScoreOptions(align="origin"))
    for one in results[:2]:
        assert one.run.status == "done", one.run.why
        assert one.score.poses == 3
        assert one.score.ate.most < 1e-9
    whys = [one.run.why for one in results[2:]]
    assert "few.txt: 2 stamps for the 3 poses of few.kitti" in whys[0]
    assert whys[1:] == ["wrong: stamp 9 is no frame of 0 to 4", "wrote no stamps (none.txt)"]


def test_what_is_kept_has_the_stamps_of_the_recording(dataset, system):
    """To the digit, and so that files can be scored again."""
    names = system("noisy", _NOISY), system("kitti", _KITTI, input="kitti", format="kitti")
    evaluate_recording(dataset, [find_system(name) for name in names])
    truth = dataset / "truth" / "cam0.tum"
    stamps = [line.split()[0] for line in truth.read_text().splitlines() if line[0] != "#"]
    for name in ("noisy", "kitti"):
        rows = (dataset / "slam" / f"{name}_1" / "errors.csv").read_text().splitlines()[1:]
        assert [row.partition(",")[0] for row in rows] == stamps
    kept = dataset / "slam" / "kitti_1" / "kitti.tum"
    assert [line.split()[0] for line in kept.read_text().splitlines()] == stamps
    done = command_line.run("evaluate", "--truth", truth, "--estimate", kept)
    assert done.stdout.splitlines()[1].split()[:2] == ["kitti", "100"]


def test_runs_have_a_spread(dataset, system):
    body = "import pathlib\n" + textwrap.dedent(_NOISY).replace(
        "0.01", "0.01 * (1 + len(list(pathlib.Path(source).glob('slam/*/*.tum'))))"
    )
    options = ScoreOptions(align="none")
    adapter = find_system(system("noisy", body))
    results = evaluate_recording(dataset, [adapter], runs=3, options=options)
    ate = [one.score.ate.rms for one in results]
    assert ate == pytest.approx([0.01, 0.02, 0.03])
    row = result_lines(results)[1]
    assert "3 of 3" in row
    assert row.split()[5:9] == ["0.02", "0.01", "to", "0.03"]


def test_an_interrupt_tells_what_is_scored(dataset, system):
    def interrupt(stage, _):
        if stage == "run noisy 2":
            raise KeyboardInterrupt

    adapter = find_system(system("noisy", _NOISY))
    with pytest.raises(KeyboardInterrupt, match=r"^1 of 3 runs are scored, in .*slam$"):
        evaluate_recording(dataset, [adapter], runs=3, progress=interrupt)
    assert len(json.loads((dataset / "slam" / "evaluation.json").read_text())) == 1


def test_one_evaluation_at_a_time(dataset, system):
    """Each would write the table of what it knew when it began."""
    adapter = find_system(system("noisy", _NOISY))
    for held in (dataset, dataset.parent):
        with holding(held), pytest.raises(OutputError, match="is being written by another"):
            evaluate_recording(dataset, [adapter])
        (dataset.parent / "world").mkdir(exist_ok=True)  # as `record` holds a world
    evaluate_recording(dataset, [adapter])
    assert not list(dataset.parent.rglob(".terrain-forge*"))


_SPOILING = """
    from pathlib import Path
    (Path(source) / "notes.txt").write_text("x")
    Path(source, "poses", "00.txt").write_text("")
"""


def test_inputs_are_made_anew_where_a_system_spoiled_them_or_the_recording_grew(
    dataset, system, caplog
):
    names = [
        system("spoiling", _SPOILING + _KITTI, input="kitti", format="kitti"),
        system("kitti", _KITTI, input="kitti", format="kitti"),
    ]
    results = evaluate_recording(dataset, chosen_systems(",".join(names), dataset))
    assert [one.score is None for one in results] == [True, False]
    assert "a system changed its input, which is made anew" in caplog.text
    (of,) = (dataset / "slam" / "inputs").iterdir()
    assert not list(of.rglob("notes.txt"))
    index = dataset / "dataset.json"
    index.write_text(index.read_text() + "\n")  # as where it grew
    chosen = chosen_systems(names[1], dataset)
    with pytest.raises(OutputError, match="has results of spoiling, of another recording"):
        evaluate_recording(dataset, chosen)
    dropped = dataset / "slam" / "spoiling_1"
    assert (dropped / "output.txt").is_file()
    (one,) = evaluate_recording(dataset, chosen, force=True)
    assert one.score is not None
    assert not of.exists()
    assert _rows(dataset) == [("kitti", 1)]
    assert not dropped.exists()


def test_what_others_put_beside_a_dropped_run_stays(dataset, system):
    evaluate_recording(dataset, [find_system(system("noisy", _NOISY))])
    slam = dataset / "slam"
    (slam / "noisy_1" / "notes.txt").write_text("mine")
    table = slam / "evaluation.json"
    table.write_text(table.read_text().replace('"system": "noisy"', '"system": "../slam/noisy"'))
    kitti = find_system(system("kitti", _KITTI, input="kitti", format="kitti"))
    evaluate_recording(dataset, [kitti], options=ScoreOptions(scale=True), force=True)
    assert (slam / "noisy_1" / "noisy.tum").is_file()
    evaluate_recording(dataset, [find_system(system("noisy", _NOISY))], force=True)
    evaluate_recording(dataset, [kitti], options=ScoreOptions(scale=True), force=True)
    assert [path.name for path in (slam / "noisy_1").iterdir()] == ["notes.txt"]


def test_a_format_that_lies_there_is_read_if_it_is_of_the_recording_as_it_is(dataset, system):
    write_dataset(dataset, "kitti", dataset / "kitti")
    adapter = find_system(system("kitti", _KITTI, input="kitti", format="kitti"))
    for of, anew in ((state_of(dataset), False), ("of before it grew", True)):
        told = {"kitti": {"options": {}, "of": of}}
        (dataset / FORMATS).write_text(json.dumps(told))
        (result,) = evaluate_recording(dataset, [adapter])
        assert result.run.status == "done"
        assert len(list(dataset.glob("slam/inputs/*/kitti"))) == anew


def _rows(dataset):
    rows = json.loads((dataset / "slam" / "evaluation.json").read_text())
    return [(row["system"], row["run"]) for row in rows]


def test_results_of_other_systems_and_runs_stay(dataset, system):
    noisy, kitti = (
        find_system(system("noisy", _NOISY)),
        find_system(system("kitti", _KITTI, input="kitti", format="kitti")),
    )
    evaluate_recording(dataset, [noisy], runs=2)
    before = json.loads((dataset / "slam" / "evaluation.json").read_text())
    evaluate_recording(dataset, [kitti])
    evaluate_recording(dataset, [noisy])
    assert sorted(_rows(dataset)) == [("kitti", 1), ("noisy", 1), ("noisy", 2)]
    after = json.loads((dataset / "slam" / "evaluation.json").read_text())
    assert before[1] in after
    with pytest.raises(OutputError, match="otherwise scored: evaluate these too, or drop them"):
        evaluate_recording(dataset, [kitti], options=ScoreOptions(scale=True))
    with pytest.raises(DataError, match="'noisy' is there twice"):
        evaluate_recording(dataset, [noisy, noisy])


def test_the_pair_and_the_lidar_are_those_of_the_recording(dataset, system):
    """A mast camera has the first folder, and the first lidar was left out."""
    mast = shutil.copytree(dataset / "mav0" / "cam0", dataset / "mav0" / "mast")
    about = json.loads((mast / "sensor.yaml").read_text())
    about["T_BS"]["data"][3] += 0.5
    about["T_BS"]["data"][7] += 0.5
    (mast / "sensor.yaml").write_text(json.dumps(about))
    text = (dataset / "truth" / "cam0.tum").read_text()
    for was, now in (("cam1", "cam2"), ("cam0", "cam1"), ("lidar0", "lidar1")):
        (dataset / "mav0" / was).rename(dataset / "mav0" / now)
        (dataset / "truth" / f"{was}.tum").rename(dataset / "truth" / f"{now}.tum")
        index = dataset / "dataset.json"
        index.write_text(index.read_text().replace(f'{was}"', f'{now}"'))
    mast.rename(dataset / "mav0" / "cam0")
    (dataset / "truth" / "cam0.tum").write_text(text.replace(" ", " 9", 1))
    index = json.loads((dataset / "dataset.json").read_text())
    index["streams"].insert(
        0, {"folder": "mav0/cam0", "name": "mast", "kind": "camera", "channels": {"data": {}}}
    )
    (dataset / "dataset.json").write_text(json.dumps(index))
    places = {"left": "cam1", "right": "cam2", "lidar": "lidar1"}
    assert sensor_places(open_recording(dataset)) == places
    body = _NOISY.replace("cam0", "cam1")
    path = system("pair", body, frame="{left}", needs=["stereo"])
    kitti = system("kitti", _KITTI, input="kitti", format="kitti", frame="{left}", needs=["stereo"])
    results = evaluate_recording(
        dataset, [find_system(path), find_system(kitti)], options=ScoreOptions(align="origin")
    )
    assert [one.run.status for one in results] == ["done", "done"]
    assert [one.frame for one in results] == ["cam1", "cam1"]
    assert results[1].score.ate.rms < 1e-9
    assert results[1].frames == 5


def test_a_place_of_a_sensor_that_was_not_recorded_is_told(tmp_path, system):
    dataset = write_recording(tmp_path / "eyes" / "dataset", lidar=False)
    (one,) = evaluate_recording(dataset, [find_system(system("low", "", frame="{lidar}"))])
    assert one.run.why == "low needs lidar, which was not recorded"
    (one,) = evaluate_recording(dataset, [find_system(system("far", "", frame="mast"))])
    assert one.run.why.startswith("no sensor 'mast'")
    assert one.run.status == "failed"  # and was not run


def test_a_pair_that_was_not_recorded_is_told_once(dataset, system):
    index = json.loads((dataset / "dataset.json").read_text())
    index["streams"] = [one for one in index["streams"] if one["folder"] != "mav0/cam1"]
    (dataset / "dataset.json").write_text(json.dumps(index))
    two = find_system(system("two", "", frame="{left}", needs=["stereo"]))
    (one,) = evaluate_recording(dataset, [two])
    assert one.run.why == "two needs stereo, which was not recorded"


def test_inputs_hold_what_their_systems_read_alone(dataset):
    rosbags = pytest.importorskip("rosbags.highlevel", reason="rosbags is not installed")
    systems = with_binaries([], ["libviso2=/bin/true", "hdl-graph-slam=/bin/true"])
    evaluate_recording(dataset, [replace(one, command="{binary}") for one in systems])
    (inputs,) = (dataset / "slam" / "inputs").iterdir()
    assert not list(inputs.rglob("velodyne"))
    (bag,) = inputs.rglob("recording.bag")
    with rosbags.AnyReader([bag]) as reader:
        assert {"/velodyne_points", "/imu0", "/tf_static"} <= reader.topics.keys()
        assert not [name for name in reader.topics if "cam" in name]


def test_an_option_may_be_a_list(dataset, system):
    path = system("bag", "pass", input="rosbag2", input_options={"sensors": ["imu0", "lidar0"]})
    evaluate_recording(dataset, [find_system(path)])
    assert list((dataset / "slam" / "inputs").glob("*/rosbag2_sensors-imu0+lidar0"))


@pytest.mark.parametrize("kind", ["kitti", "rosbag1", "rosbag2"])
def test_a_disk_without_room_for_an_input_is_told_at_once(dataset, system, kind, monkeypatch):
    """By what is about to be written, which the format knows to a quarter."""
    write_dataset(dataset, kind, dataset / "whole")
    written = sum(one.stat().st_size for one in (dataset / "whole").rglob("*") if one.is_file())
    told = system("mine", "pass", input=kind)
    for free, room in ((0.6 * written, False), (1.4 * written, True)):
        usage = shutil.disk_usage(dataset)._replace(free=int(free))
        monkeypatch.setattr(shutil, "disk_usage", lambda _, usage=usage: usage)
        (one,) = evaluate_recording(dataset, [find_system(told)])
        assert one.run.status == ("lost" if room else "failed"), one.run.why
        assert (": what is missing needs about " in one.run.why) != room


def test_all_may_be_given_more_time_or_less(dataset, system):
    path = system("slow", "import time; time.sleep(60)")
    (one,) = evaluate_recording(dataset, [find_system(path)], timeout_s=1.0)
    assert one.run.why == "killed after 1 s"
    done = command_line.run("evaluate", dataset, "--systems", path, "--timeout", "1")
    assert "slow: timeout: killed after 1 s" in done.stdout


_LOST = """
    rows = open(f"{source}/poses/00.txt").readlines()
    guess = rows[0].replace("0.0", "0.5")
    open(target, "w").writelines({told})
"""
"""As ORB-SLAM2 writes: none of before it began, and where it is lost what it expected, again."""


@pytest.mark.parametrize("told", ["rows[1:]", "[rows[0], guess, guess, *rows[3:]]"])
def test_frames_before_the_first_and_those_that_are_alike_have_no_pose(dataset, system, told):
    body = _LOST.replace("{told}", told)
    path = system("orb", body, input="kitti", format="kitti", frames="last")
    (one,) = evaluate_recording(dataset, [find_system(path)], options=ScoreOptions(align="origin"))
    assert one.score.poses == (3 if "guess" in told else 4)
    assert one.score.ate.rms < 1e-9


_STAYED = """
    rows = open(f"{source}/poses/00.txt").readlines()
    open(target, "w").writelines([rows[n] for n in (0, 1, 1, 3, 4)][:{count}])
"""
"""A pose for each frame, the last one again where it was lost."""


def test_of_poses_of_all_frames_those_that_repeat_are_none(dataset, system):
    options = ScoreOptions(align="origin")
    for frames, count in (("found", 4), ("each", 5)):
        body = _STAYED.replace("{count}", "5")
        path = system(frames, body, input="kitti", format="kitti", frames=frames)
        (one,) = evaluate_recording(dataset, [find_system(path)], options=options)
        assert one.score.poses == count
        assert (one.score.ate.rms < 1e-9) == (frames == "found")
    fewer = _STAYED.replace("{count}", "4")  # which ones these are is not guessed
    path = system("fewer", fewer, input="kitti", format="kitti", frames="found")
    (one,) = evaluate_recording(dataset, [find_system(path)], options=options)
    assert (one.run.status, "4 poses of 5 frames" in one.run.why) == ("lost", True)


def test_a_drivers_own_time_is_not_the_systems(dataset, system):
    body = "sum(range(9_000_000))\n" + textwrap.dedent(_NOISY)
    own = body + "import time\nopen('own_s.txt', 'w').write(str(time.process_time()))\n"
    systems = [find_system(system("whole", body)), find_system(system("own", own))]
    whole, part = evaluate_recording(dataset, systems)
    assert 0.0 < part.run.processor_s < whole.run.processor_s


def test_tables_have_all_measures_and_the_text_those_that_a_terminal_holds(
    dataset, system, tmp_path
):
    adapter = find_system(system("a-system-of-16-b", _NOISY, needs=["stereo"]))
    options = ScoreOptions(align="all", drift_over_m=0.1, stations_m=0.05)
    evaluate_recording(dataset, [adapter], runs=3, options=options)
    lines = (dataset / "slam" / "evaluation.txt").read_text().splitlines()
    assert max(map(len, lines)) <= 100
    with (dataset / "slam" / "evaluation.csv").open(newline="") as file:
        (row,) = csv.DictReader(file)
    assert float(row["RPE median [m]"]) >= 0.0
    assert float(row["yaw drift [deg]"]) >= 0.0
    assert " to " in row["TDr of runs [%]"]
    assert row["KITTI t [%]"] == row["KITTI r [deg/m]"] == ""  # of 100 m and more


@pytest.mark.parametrize("name", ["slam", "slam/noisy_1", "slam/inputs"])
def test_results_are_not_written_behind_a_link(dataset, system, tmp_path, name):
    (home := tmp_path / "home").mkdir()
    (home / "noisy.tum").write_text("mine")
    (dataset / name).parent.mkdir(exist_ok=True)
    (dataset / name).symlink_to(home)
    with pytest.raises(OutputError, match=f"{name} is a link"):
        evaluate_recording(dataset, [find_system(system("noisy", _NOISY))])
    assert [path.read_text() for path in home.iterdir()] == ["mine"]
