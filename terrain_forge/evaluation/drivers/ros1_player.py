"""A system of ROS 1 over a bag: BINARY BAG TRAJECTORY, and what it publishes.

BINARY is a catkin workspace (a folder with devel/setup.bash, install/setup.bash or setup.bash), a
launch file, or a program. A master of its own is started, the system, and a recorder of the topics;
then the bag is played. roscore, rosparam, rosbag and roslaunch are those of the workspace or of the
PATH; the recorded bag is read by the library rosbags.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
import os
import resource
import shlex
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from recorded import about, figure, quaternion_of, tell_own_work, transform, write_pose

POINTS = "/velodyne_points"
BASE = "base_link"
Z_FORWARD = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""From axes z forward, x left, y up to x forward, y left, z up."""
GRACE = 30.0
ABANDONED = 8.0
"""How long all have to end once this program was told to [s]."""
NOT_FOUND = 127
"""How a shell ends for a program that is not there."""
LATEST = 300.0
"""How long a system that is behind may publish after the bag's end [s]."""


def arguments() -> argparse.Namespace:
    """What the command says."""
    parser = argparse.ArgumentParser()
    for name in ("binary", "bag", "trajectory"):
        parser.add_argument(name, type=Path)
    parser.add_argument("--recording", type=Path, required=True)
    parser.add_argument("--launch", default="", help="what roslaunch starts of a workspace")
    parser.add_argument("--lidar", default="lidar0", help="folder of the lidar that is played")
    parser.add_argument("--lidars", default="", help="RINGS=WORD,… for LIDAR in --launch")
    parser.add_argument("--topic", required=True, help="of nav_msgs/Odometry")
    parser.add_argument("--correction", help="topic of TransformStamped, from --topic's frame")
    parser.add_argument("--axes", choices=["x-forward", "z-forward"], default="x-forward")
    parser.add_argument("--rate", type=float, default=1.0, help="times as quick as the recording")
    parser.add_argument("--delay", type=float, default=5.0, help="for the system to start [s]")
    parser.add_argument("--settle", type=float, default=10.0, help="of stillness at its end [s]")
    return parser.parse_args()


def system_of(told: argparse.Namespace) -> tuple[list[str], list[str]]:
    """What comes before each program of ROS, and the command that starts the system."""
    binary = told.binary
    if binary.is_dir():
        setups = [binary / name / "setup.bash" for name in ("devel", "install", "")]
        setup = next((one for one in setups if one.is_file()), None)
        if setup is None:
            sys.exit(f"{binary} has no devel/setup.bash, install/setup.bash or setup.bash")
        launch = told.launch.replace("LIDAR", lidar_word(told) if told.lidars else "")
        sourced = f'source {shlex.quote(str(setup))} && exec "$@"'
        return ["bash", "-c", sourced, "bash"], ["roslaunch", *shlex.split(launch)]
    if binary.suffix == ".launch":
        return [], ["roslaunch", str(binary)]
    return [], [str(binary)]


def lidar_word(told: argparse.Namespace) -> str:
    """What the launch file of the recorded lidar is called."""
    words: dict[str, str] = dict(pair.split("=") for pair in told.lidars.split(","))
    rings = f"{figure(told.recording, told.lidar, 'rings'):g}"
    if rings not in words:
        sys.exit(f"the lidar has {rings} rings, the system knows {', '.join(words)}")
    return words[rings]


class Programs:
    """Programs of ROS with a master of their own; all are ended at the end."""

    def __init__(self, before: list[str]) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.before, self.running = before, []  # type: list[str], list[Any]
        self.used: dict[int, float] = {}
        here = Path.cwd()
        more = {"ROS_MASTER_URI": f"http://127.0.0.1:{self.port}", "ROS_HOME": str(here / "ros")}
        self.environment = {**os.environ, **more, "ROS_HOSTNAME": "127.0.0.1"}

    def start(self, *words: str) -> subprocess.Popen[bytes]:
        """Start a program in a group of its own."""
        try:
            process = subprocess.Popen(
                [*self.before, *words], env=self.environment, start_new_session=True
            )
        except FileNotFoundError:
            sys.exit(f"{words[0]} was not found")
        except OSError as error:
            sys.exit(f"{words[0]}: {(error.strerror or str(error)).lower()}")
        self.running.append(process)
        return process

    def run(self, *words: str) -> int:
        """Run a program to its end."""
        return self.start(*words).wait()

    def status(self, process: subprocess.Popen[bytes], seconds: float = 0.0) -> int | None:
        """How a program ended within a time [s], which notes what it and its own had used."""
        before = used_s(resource.RUSAGE_CHILDREN)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(seconds)
            more = used_s(resource.RUSAGE_CHILDREN) - before
            self.used[process.pid] = self.used.get(process.pid, 0.0) + more
        return process.returncode

    def end(self, process: subprocess.Popen[bytes]) -> None:
        """Interrupt a program as Ctrl-C does, and kill what is left of it."""
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
            try:
                os.killpg(process.pid, number)
            except ProcessLookupError:
                break
            self.status(process, GRACE)
        process.wait()

    def abandon(self) -> None:
        """End all at once and soon, and this program too."""
        for number in (signal.SIGINT, signal.SIGKILL):
            for process in self.running:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(process.pid, number)
            until = time.monotonic() + ABANDONED
            while time.monotonic() < until and any(one.poll() is None for one in self.running):
                time.sleep(0.05)
        os._exit(143)

    def end_all(self) -> None:
        """End all, the last first."""
        while self.running:
            self.end(self.running.pop())


def used_s(whose: int) -> float:
    """Processor time of this program, or of its children that ended [s]."""
    used = resource.getrusage(whose)
    return used.ru_utime + used.ru_stime


def play(told: argparse.Namespace, recorded: Path) -> float:
    """Run the system over the bag, record what it publishes; its processor time [s]."""
    before, command = system_of(told)
    programs = Programs(before)
    signal.signal(signal.SIGTERM, lambda *_: programs.abandon())
    try:
        core = programs.start("roscore", "-p", str(programs.port))
        begin = time.monotonic()
        while refused := programs.run("rosparam", "set", "/use_sim_time", "true"):
            if core.poll() is not None:
                unknown = core.returncode == NOT_FOUND
                how = "was not found" if unknown else f"ended with status {core.returncode}"
                sys.exit(f"roscore {how}")
            if time.monotonic() - begin > GRACE:
                sys.exit(f"roscore did not start: rosparam ended with status {refused} all along")
            time.sleep(0.5)
        topics = [told.topic, *([told.correction] if told.correction else [])]
        recorder = programs.start(
            *("rosbag", "record", "-O", str(recorded), "--buffsize=0", "--chunksize=1", *topics)
        )
        system = programs.start(*command)
        played = ["/tf_static", POINTS, *imus(told.recording)]
        player = programs.start(
            *("rosbag", "play", "--clock", "--quiet", f"--delay={told.delay:g}"),
            *(f"--rate={told.rate:g}", str(told.bag), "--topics", *played),
        )
        while player.poll() is None:
            status = programs.status(system)
            if status or (status == 0 and command[0] == "roslaunch"):  # a script may go on behind
                sys.exit(f"{' '.join(command)} ended with status {status} while the bag was played")
            time.sleep(0.1)
        if player.returncode:
            sys.exit(f"rosbag play ended with status {player.returncode}")
        settle(recorded, told.settle)
        save(recorder, recorded)
    finally:
        programs.end_all()
    if not recorded.is_file():
        sys.exit("rosbag record wrote no bag")
    return programs.used.get(system.pid, 0.0)


def settle(recorded: Path, still_s: float) -> None:
    """Wait until nothing was recorded for a time [s]: a system may be behind the bag."""
    active = recorded.with_name(f"{recorded.name}.active")
    size, since = -1, time.monotonic()
    latest = since + LATEST
    while time.monotonic() < min(since + still_s, latest):
        if active.is_file() and active.stat().st_size != size:
            size, since = active.stat().st_size, time.monotonic()
        time.sleep(0.05)


def save(recorder: subprocess.Popen[bytes], recorded: Path) -> None:
    """Interrupt a recorder and wait for its bag: rosbag ends before its child, which saves it."""
    os.killpg(recorder.pid, signal.SIGINT)
    until = time.monotonic() + GRACE
    while not recorded.is_file() and time.monotonic() < until:
        time.sleep(0.05)


def imus(recording: Path) -> list[str]:
    """Topics of the IMUs."""
    streams = about(recording)["streams"]
    return [f"/{Path(one['folder']).name}" for one in streams if one["kind"] == "imu"]


def matrix_of(place: Any, turn: Any) -> Any:
    """A pose of a message, shape [4, 4]."""
    x, y, z, w = np.array([turn.x, turn.y, turn.z, turn.w]) / np.linalg.norm(
        [turn.x, turn.y, turn.z, turn.w]
    )
    found = np.eye(4)
    found[:3, 3] = place.x, place.y, place.z
    found[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return found


@functools.cache
def lidar_of(recording: Path, lidar: str, moved: str) -> Any:
    """From a lidar's frame to the one that a system moves, shape [4, 4]: base_link's or its own."""
    return transform(recording, lidar) if moved.strip("/") == BASE else np.eye(4)


def published(told: argparse.Namespace, recorded: Path) -> dict[int, Any]:
    """The lidar's poses by stamps [ns], with the correction that was the last when each came."""
    from rosbags.highlevel import AnyReader

    poses: dict[int, Any] = {}
    correction = np.eye(4)
    axes = np.eye(4)
    if told.axes == "z-forward":
        axes[:3, :3] = Z_FORWARD
    with AnyReader([recorded]) as bag:
        for connection, _, raw in bag.messages():
            message: Any = bag.deserialize(raw, connection.msgtype)
            stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
            if connection.topic == told.correction:
                moved = message.transform
                correction = matrix_of(moved.translation, moved.rotation)
            elif connection.topic == told.topic:
                pose = message.pose.pose
                whole = correction @ matrix_of(pose.position, pose.orientation)
                lidar = lidar_of(told.recording, told.lidar, message.child_frame_id)
                poses[stamp] = axes @ whole @ axes.T @ lidar
    return dict(sorted(poses.items()))


def main() -> None:
    """Play, and write the trajectory."""
    told = arguments()
    recorded = Path.cwd() / "published.bag"
    system_s = play(told, recorded)
    poses = published(told, recorded)
    if not poses:
        sys.exit(f"nothing was published on {told.topic}")
    with told.trajectory.open("w", encoding="utf-8") as file:
        for stamp, pose in poses.items():
            write_pose(file, stamp, pose[:3, 3], quaternion_of(pose[:3, :3]))
    all_s = used_s(resource.RUSAGE_SELF) + used_s(resource.RUSAGE_CHILDREN)
    tell_own_work(all_s - system_s)


if __name__ == "__main__":
    main()
