"""``handsim live SCENE --measure``: what a session costs and how late things are, with a page and a tracker in another process."""
from __future__ import annotations

import json
import os
import socket
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from .._errors import Error
from .._scene import Scene
from .frames import HEAD


def measure(scene: Scene, seconds: float) -> int:
    from . import live

    sys.setswitchinterval(0.001)
    tracked = bool(scene.axes and scene.hands)
    with tempfile.TemporaryDirectory() as folder:
        frames = Path(folder) / "frames.npy"
        port = free_port()
        if tracked:
            np.save(frames, tracked_frames(scene))
        page = live(scene, play=True, stream=[f"udp://127.0.0.1:{port}?origin=world"] if tracked else [])
        with page:
            client = subprocess.Popen([sys.executable, "-m", "handsim._live.measure", page.url, str(seconds + 2)], stdout=subprocess.PIPE)
            time.sleep(1.0)
            page.session.call(lambda session: session.lateness.clear()).result()
            quiet = sample(page.session, seconds / 2 if tracked else seconds)
            sender = None
            if tracked:
                sender = subprocess.Popen([sys.executable, "-m", "handsim._live.measure", str(frames), str(port), str(seconds)])
                time.sleep(0.5)
            followed = sample(page.session, seconds / 2) if tracked else None
            latency = np.array(page.session.latencies)
            out, _ = client.communicate()
            if sender is not None:
                sender.wait()
            changes = built(page.session, scene)
    if client.returncode:
        raise Error(f"--measure: got a page's process that has ended with status {client.returncode}, need its figures", "output")
    shown = json.loads(out)
    print(f"{scene.title}: {scene.engine}, step {1e3 * scene.step:g} ms, {seconds:g} s; load of the machine {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    row("simulated by real time", f"{quiet['factor']:.3f}")
    row("CPU time of a core, with one page", f"{100 * quiet['cpu']:.1f} %", f"steps alone {100 * quiet['steps']:.1f} %")
    row("a step is complete after its time", *of(quiet["late"], 1e3, "ms"))
    row("views at the page", f"{shown['views']:.1f} a second", f"{shown['bytes'] / 1e3:.1f} kB/s")
    row("a pull is in a view at the page", *of(np.array(shown["pulls"]), 1e3, "ms"))
    if followed is not None:
        row("with tracked hands at 90 Hz: CPU time", f"{100 * followed['cpu']:.1f} %", f"factor {followed['factor']:.3f}")
        row("from a frame to the state", *of(latency, 1e3, "ms"))
    if changes:
        row("a hand of another stature moves after", *of(np.array(changes), 1e3, "ms"))
    return 0


def row(name: str, *values: str) -> None:
    print(f"  {name:44}" + ", ".join(values))


def of(values: Any, scale: float, unit: str) -> list[str]:
    if not len(values):
        return ["nothing"]
    low, high = np.percentile(values, [50, 99]) * scale
    return [f"median {low:.2f} {unit}", f"99 % within {high:.2f} {unit}", f"largest {float(np.max(values)) * scale:.2f} {unit}", f"of {len(values)}"]


def sample(session: Any, seconds: float) -> dict[str, Any]:
    def now(session: Any) -> tuple[float, float, float, float]:
        return time.monotonic(), time.process_time(), time.thread_time(), session.course.time

    session.call(lambda session: session.lateness.clear()).result()
    late: list[Any] = []
    begin = session.call(now).result()
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        time.sleep(min(1.0, max(0.01, end - time.monotonic())))
        late += session.call(lambda session: (list(session.lateness), session.lateness.clear())[0]).result()
    last = session.call(now).result()
    wall, cpu, steps, simulated = (b - a for a, b in zip(begin, last))
    return {"factor": simulated / wall, "cpu": cpu / wall, "steps": steps / wall, "late": np.concatenate(late) if late else np.zeros(0)}


def built(session: Any, scene: Scene) -> list[float]:
    """Seconds from the command to a scene of another stature, of some of them."""
    from .commands import Command

    out = []
    for stature in (1.6, 1.7, 1.8, 1.9) if scene.hands else ():
        begin, before = time.monotonic(), session.course.scene
        changes = {f"hands.{i}.person.stature": stature for i in range(len(scene.hands))}
        session.send(Command("scene", {"changes": changes}))
        while session.course.scene is before and time.monotonic() - begin < 20:
            time.sleep(0.0005)
        out.append(time.monotonic() - begin)
    return out


def tracked_frames(scene: Scene) -> Any:
    """Points of the scene's hands as its own run moves them, at 90 Hz, with 2 mm of noise; shape (frames, hands, 21, 3)."""
    from .._simulation import Simulation
    from .tracker import HandFilter

    simulation, filters, out = Simulation(scene), [HandFilter(scene, i) for i in range(len(scene.hands))], []
    index = [[scene.coordinates.index(axis) for axis in each.axes] for each in filters]
    draw = np.random.default_rng(1)
    for _ in range(90 * 4):
        wrists = simulation._core.wrists()
        q = np.array(simulation.q)
        rest = np.array([0, 0, 0.3, 1, 0, 0, 0])
        out.append([each.points(np.concatenate((wrists[i] if i < len(wrists) else rest, q[index[i]]))) for i, each in enumerate(filters)])
        simulation.step(substeps=max(1, round(1 / 90 / scene.step)))
    return np.array(out) + draw.normal(0, 2e-3, np.array(out).shape)


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as of:
        of.bind(("127.0.0.1", 0))
        return int(of.getsockname()[1])


def send(file: str, port: int, seconds: float) -> None:
    """Sends frames at 90 Hz."""
    frames = np.load(file)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as to:
        begin = time.monotonic()
        for k in range(int(90 * seconds)):
            time.sleep(max(0.0, begin + k / 90 - time.monotonic()))
            data = b"".join(struct.pack("<4sBBHd", b"HSH1", side, 21, 0, k / 90) + hand.astype("<f4").tobytes()
                            for side, hand in enumerate(frames[k % len(frames)][:2]))
            to.sendto(data, ("127.0.0.1", port))


async def watch(url: str, seconds: float) -> dict[str, Any]:
    """A page: counts views, and pulls a body now and then."""
    import asyncio

    import aiohttp

    base, _, token = url.partition("/?")
    views, size, pulls, since, begin = 0, 0, [], None, time.monotonic()
    next_pull, pulling = begin + 0.5, False
    async with aiohttp.ClientSession() as session, session.ws_connect(f"{base}/socket?{token}", origin=base) as page:
        while time.monotonic() - begin < seconds:
            now = time.monotonic()
            if now > next_pull:
                next_pull, pulling = now + 0.11, not pulling
                pull = {"do": "spring", "id": 0, "body": 3, "point": [0, 0, 0], "goal": [0, 0, 0.3]} if pulling else {"do": "spring", "id": 0, "release": True}
                since = now if pulling else None
                await page.send_str(json.dumps(pull))
            try:
                message = await page.receive(timeout=0.02)
            except asyncio.TimeoutError:
                continue
            if message.type is aiohttp.WSMsgType.CLOSED:
                break
            if message.type is aiohttp.WSMsgType.BINARY:
                views, size = views + 1, size + len(message.data)
                if since is not None and HEAD.unpack_from(message.data)[6]:
                    pulls.append(time.monotonic() - since)
                    since = None
    spent = time.monotonic() - begin
    return {"views": views / spent, "bytes": size / spent, "pulls": pulls}


if __name__ == "__main__":
    if sys.argv[1].startswith("http"):
        import asyncio

        print(json.dumps(asyncio.run(watch(sys.argv[1], float(sys.argv[2])))))
    else:
        send(sys.argv[1], int(sys.argv[2]), float(sys.argv[3]))
