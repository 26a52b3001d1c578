#!/usr/bin/python3
"""Attacks a live session on the loopback address with random input of bounded count, and says what did not hold.

attack.py [--share 1.0] [--seed 1]; with handsim on PYTHONPATH. Held means: a wrong token gets 403 or 400; no request gets 500;
no frame, command, datagram or recording raises anything but an Error of kind input (a recording that was changed: of kind
physics, too); the session steps on; nothing is printed; memory stays.
"""
import argparse
import base64
import contextlib
import io
import json
import os
import random
import resource
import socket
import sys
import time
import zlib
from urllib.parse import urlsplit

import handsim as hs
from handsim._live.commands import READERS, read_command
from handsim._live.replay import Replay
from handsim._live.session import Session
from handsim._live.streams import Follower

ODD = [None, True, False, 0, -1, 1, 2**31, 2**63, 10**400, -10**400, 1e308, -1e308, 1e-308, float("inf"), float("nan"), "", "x", "\ud800", "\0", "flat",
       [], [0], [[]], {}, {"a": 1}, [0, 0, 0], [1e308] * 3, [10**400] * 3, ["x"] * 3, [None] * 21, [[0, 0, 0]] * 21, "9" * 5000]
KEYS = ["do", "on", "steps", "value", "time", "id", "release", "body", "point", "goal", "stiffness", "force", "values", "name", "stature", "mass", "engine", "step", "hands", "t"]


class Attack:
    def __init__(self, seed, share):
        self.draw, self.share, self.rows, self.failures = random.Random(seed), share, [], []
        self.live = hs.live(hs.load("grasp_power_can", engine="articulated"), play=True, stream=["ws"])
        self.session, self.url = self.live.session, urlsplit(self.live.url)

    def count(self, most):
        return range(max(1, int(most * self.share)))

    def row(self, name, count, said):
        begin, end = self.session.call(lambda s: s.course.tick).result(60), time.monotonic() + 60
        self.session.send(read_command({"do": "reset"}, self.session.facts))
        self.session.send(read_command({"do": "play", "on": True}, self.session.facts))
        while self.session.call(lambda s: s.course.tick).result(60) < begin + 20 and time.monotonic() < end:
            time.sleep(0.01)
        if time.monotonic() >= end or self.session.problem is not None:
            self.failures.append(f"{name}: the session does not step on: {self.session.problem!r}")
        print(f"{name}: {count}, {said}", flush=True)

    def flipped(self, data, most=6):
        out = bytearray(data)
        for _ in range(self.draw.randint(1, most)):
            at, kind = self.draw.randrange(len(out) + 1), self.draw.random()
            if kind < 0.5 and at < len(out):
                out[at] = self.draw.randrange(256)
            elif kind < 0.75:
                out[at:at] = self.draw.randbytes(self.draw.choice([1, 2, 40]))
            else:
                del out[at:at + self.draw.choice([1, 2, 40])]
        return bytes(out) or b"\0"

    def connect(self):
        for _ in range(100):
            try:
                out = socket.create_connection((self.url.hostname, self.url.port), 5)
                out.settimeout(2)
                return out
            except OSError:
                time.sleep(0.05)
        raise RuntimeError("no connection")

    def answer(self, data):
        with self.connect() as out, contextlib.suppress(OSError):
            out.sendall(data)
            return out.recv(64)
        return b""

    def request(self, path, query):
        return b"GET " + path + b"?" + query + b" HTTP/1.1\r\nHost: " + self.url.netloc.encode() + b"\r\nConnection: close\r\n\r\n"

    def tally(self, name, answers, allowed):
        found = {}
        for each in answers:
            key = each[9:12].decode("latin-1") if each.startswith(b"HTTP/") else "none"
            found[key] = found.get(key, 0) + 1
        if not found.keys() <= allowed:
            self.failures.append(f"{name}: answers {found}")
        self.row(name, sum(found.values()), f"answers {dict(sorted(found.items()))}")

    def tokens(self):
        token = self.url.query.encode()[len("token="):]

        def spoilt():
            kind = self.draw.random()
            if kind < 0.5:
                other = self.flipped(token).replace(b" ", b"+").replace(b"\r", b"").replace(b"\n", b"").replace(b"&", b"").replace(b"#", b"")
                return b"token=" + (other if other != token else b"")
            return self.draw.choice([b"token=" + base64.urlsafe_b64encode(self.draw.randbytes(24)), b"token=" + token[:-1], b"token=" + token + b"=", b"Token=" + token, b"token[]=" + token])
        path = [b"/", b"/socket", b"/save/recording", b"/x"]
        self.tally("wrong tokens", [self.answer(self.request(self.draw.choice(path), spoilt())) for _ in self.count(3000)], {"403", "400", "404", "none"})

    def requests(self):
        # The right token is in most of them: what is behind it is attacked. A page that is whole gets 200.
        whole = [self.request(path, self.url.query.encode()) for path in (b"/", b"/save/recording", b"/save/scene", b"/save/x", b"/socket", b"//", b"/%ff", b"/..")]
        answers = [self.answer(self.flipped(self.draw.choice(whole))) for _ in self.count(3000)]
        self.tally("spoilt requests", answers, {"200", "400", "403", "404", "405", "409", "505", "501", "417", "426", "411", "413", "none"})

    def page(self):
        out = self.connect()
        out.sendall((f"GET /socket?{self.url.query} HTTP/1.1\r\nHost: {self.url.netloc}\r\nOrigin: http://{self.url.netloc}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
                     f"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {base64.b64encode(os.urandom(16)).decode()}\r\n\r\n").encode())
        return out

    def message(self):
        hands = {side: {"joints": self.draw.choice([*ODD, [[0, 0, 0]] * 20 + [self.draw.choice(ODD)]])} for side in self.draw.sample(["right", "left", "x"], 1)}
        base = self.draw.choice([{"hands": hands}, {"do": self.draw.choice(list(READERS))}])
        return {**base, **{self.draw.choice(KEYS[1:]): self.draw.choice(ODD) for _ in range(self.draw.randint(0, 5))}}

    def sockets(self):
        sent = 0
        for _ in self.count(120):
            with self.page() as out, contextlib.suppress(OSError):
                for _ in range(30):
                    data = json.dumps(self.message()).encode()
                    data = self.flipped(data) if self.draw.random() < 0.3 else data
                    size = len(data)
                    frame = bytes([0x81]) + (bytes([0x80 | size]) if size < 126 else b"\xfe" + size.to_bytes(2, "big")) + bytes(4) + data
                    out.sendall(self.flipped(frame, 2) if self.draw.random() < 0.05 else frame)
                    sent += 1
                time.sleep(0.02)
        self.row("messages of pages", sent, f"{len(self.live._server.pages)} pages are open")

    def commands(self):
        taken, session = 0, Session(hs.load("stability/resting_capsule"))
        names = [*session.facts.numbers, *session.facts.poses]
        for _ in self.count(20000):
            message = self.message()
            if self.draw.random() < 0.2:
                message["name"] = self.draw.choice(names)
            try:
                command = read_command(message, session.facts)
            except hs.Error:
                continue
            if command.name != "scene":
                session.send(command)
                session._take()
                taken += 1
        if session.problem is not None:
            self.failures.append(f"commands: {session.problem!r}")
        self.row("commands", len(self.count(20000)), f"{taken} fit")

    def datagrams(self):
        session = Session(hs.load("grasp_power_can", engine="articulated"))
        follower, kinds = Follower(session), {}
        hand = follower._hands["right"].filter
        points = hand.points([0, 0, 0.3, 1, 0, 0, 0, *[0.3] * len(hand.axes)])
        from handsim._live.streams import PACKED
        for k in self.count(10000):
            t = self.draw.choice([k / 90, k / 90, -1e308, 1e308, 0.0, float("nan"), self.draw.uniform(-1e6, 1e6)])
            whole = (PACKED.pack(b"HSH1", 0, 21, 0, t) + points.astype("<f4").tobytes() if self.draw.random() < 0.5 else
                     json.dumps({"t": t, "hands": {"right": {"joints": (points * self.draw.choice([1, 1, 0, 1e-12, 1e3, -1])).tolist()}}}).encode())
            follower.data(self.flipped(whole) if self.draw.random() < 0.7 else whole)
            if follower.last_fault and not follower.last_fault.startswith(("hands:", "joints", "t:", "frame:", "Expecting", "Extra data", "Invalid", "'utf", "Unterminated", "Illegal")):
                kinds[follower.last_fault[:40]] = kinds.get(follower.last_fault[:40], 0) + 1
            follower.last_fault = ""
            if k % 10 == 0:
                session._take()
                session._steps(1)
        follower.close()
        if session.problem is not None:
            self.failures.append(f"datagrams: {session.problem!r}")
        self.row("datagrams", len(self.count(10000)), f"{follower.faults} left out, {follower.frames} taken; {sum(kinds.values())} of them for another reason than a key: {dict(list(kinds.items())[:6])}")

    def recordings(self):
        session = Session(hs.load("two_hands", engine="articulated"))
        facts = session.facts
        for message in ({"do": "torques", "values": [0.01] * len(facts.coordinates)}, {"do": "step", "steps": 300}, {"do": "push", "body": facts.bodies.index("right.index_distal"), "force": [1, 0, 0]},
                        {"do": "spring", "id": 0, "body": facts.bodies.index("left.index_distal"), "point": [0, 0, 0], "goal": [0, 0, 1]}, {"do": "number", "name": "gravity", "value": [0, 0, -3]},
                        {"do": "step", "steps": 100}, {"do": "reset"}, {"do": "step", "steps": 900}):
            session.send(read_command(message, facts))
            session._take()
        lines = session.history.recording().splitlines()
        found, slowest = {}, 0.0
        for _ in self.count(1500):
            text, begin = b"\n".join(self.spoilt(lines)) + b"\n", time.monotonic()
            try:
                replay = Replay(text)
                replay.run()
                end = "repeats"
                replay.files.close()
            except hs.Error as error:
                end = error.kind
                str(error).encode()
            except Exception as error:
                end = f"{type(error).__name__}: {error}"[:100]
                self.failures.append(f"recordings: {end}")
            found[end], slowest = found.get(end, 0) + 1, max(slowest, time.monotonic() - begin)
        self.row("spoilt recordings", sum(found.values()), f"{found}; slowest {slowest:.1f} s")

    def spoilt(self, lines):
        lines, kind = list(lines), self.draw.random()
        if kind < 0.25:
            at = self.draw.randrange(len(lines))
            lines[at] = self.flipped(lines[at])
        elif kind < 0.35:
            del lines[self.draw.randrange(len(lines))]
        elif kind < 0.45:
            self.draw.shuffle(lines)
        elif kind < 0.6:  # the scene's own text
            head = json.loads(lines[0])
            head["files"] = {name: base64.b64encode(zlib.compress(self.flipped(zlib.decompress(base64.b64decode(data)), 3))).decode() for name, data in head["files"].items()}
            lines[0] = json.dumps(head).encode()
        else:
            at = self.draw.randrange(len(lines))
            line = json.loads(lines[at])
            self.change(line)
            lines[at] = json.dumps(line).encode()
        return lines

    def change(self, of):
        """One value somewhere within."""
        keys = list(of) if isinstance(of, dict) else list(range(len(of)))
        if not keys or isinstance(of, dict) and self.draw.random() < 0.1:
            if isinstance(of, dict):
                of[self.draw.choice([*KEYS, "push", "springs", "numbers", "scene", "wrists", "reset", "failed", "hash", "end"])] = self.draw.choice(ODD)
            return
        key = self.draw.choice(keys)
        if isinstance(of[key], (dict, list)) and of[key] and self.draw.random() < 0.7:
            self.change(of[key])
        else:
            of[key] = self.draw.choice(ODD)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--share", type=float, default=1.0, help="of the counts")
    parser.add_argument("--seed", type=int, default=1)
    words = parser.parse_args()
    said = io.StringIO()
    with contextlib.redirect_stderr(said):
        attack = Attack(words.seed, words.share)
        with attack.live:
            memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
            for work in (attack.tokens, attack.requests, attack.sockets, attack.commands, attack.datagrams, attack.recordings):
                work()
            memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - memory
    if said.getvalue():
        attack.failures.append(f"printed: {said.getvalue()[:1000]}")
    print(f"memory grew by {memory / 1024:.0f} MB; {len(attack.failures)} that did not hold")
    print("\n".join(attack.failures[:30]))
    return 1 if attack.failures else 0


if __name__ == "__main__":
    sys.exit(main())
