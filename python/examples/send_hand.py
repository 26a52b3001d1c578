#!/usr/bin/python3
"""Sends frames of a hand to handsim live: 21 points in m, 90 times a second.

    handsim live grasp_power_can --engine articulated --play --stream udp://127.0.0.1:5005
    python3 python/examples/send_hand.py 5005
"""
import json
import math
import socket
import sys
import time

to = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
lengths = {"index": (0.09, 0.045, 0.026, 0.022), "middle": (0.09, 0.05, 0.03, 0.023), "ring": (0.085, 0.046, 0.029, 0.023), "little": (0.08, 0.036, 0.021, 0.021)}
begin = time.time()
while True:
    t = time.time() - begin
    bend = 0.5 - 0.4 * math.cos(2 * t)  # of each joint [rad]
    joints = {"wrist": [0, 0, 0], "thumb_cmc": [-0.025, 0.02, -0.01], "thumb_mcp": [-0.05, 0.05, -0.02], "thumb_ip": [-0.065, 0.08, -0.03], "thumb_tip": [-0.07, 0.105, -0.035]}
    for i, (finger, of) in enumerate(lengths.items()):
        x, y, z, angle = 0.028 - 0.019 * (3 - i), of[0], 0.0, 0.0
        for joint, length in zip(("mcp", "pip", "dip", "tip"), (*of[1:], 0)):
            joints[f"{finger}_{joint}"] = [x, y, z]
            angle += bend  # a right hand, palm down: y towards the fingers, z out of the back
            y, z = y + length * math.cos(angle), z - length * math.sin(angle)
    to.sendto(json.dumps({"t": t, "hands": {"right": {"joints": joints}}}).encode(), ("127.0.0.1", int(sys.argv[1])))
    time.sleep(1 / 90)
