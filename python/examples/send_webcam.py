#!/usr/bin/python3
"""Sends the hands that a webcam sees to handsim live, by MediaPipe. Tested with its wheel 0.10.14, which has the models; newer ones (1.2.3) have
neither models nor this interface.

    pip install 'mediapipe==0.10.14' opencv-python
    handsim live grasp_power_can --engine articulated --play --stream 'udp://127.0.0.1:5005?up=y'
    python3 python/examples/send_webcam.py 5005              # or a video: send_webcam.py 5005 hands.mp4
"""
import json
import socket
import sys
import time

import cv2
import mediapipe

to = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
film = sys.argv[2] if len(sys.argv) > 2 else None
camera = cv2.VideoCapture(film or 0)
tracker = mediapipe.solutions.hands.Hands(max_num_hands=2, model_complexity=1)
SIDES = {"Left": "right", "Right": "left"}  # MediaPipe takes a picture for a mirror's; this one is as the camera sees
while True:
    ok, picture = camera.read()
    if not ok:
        sys.exit(None if film else "no picture from the camera")
    t = 1e-3 * camera.get(cv2.CAP_PROP_POS_MSEC) if film else time.time()
    found = tracker.process(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB))
    hands = {}
    for side, points in zip(found.multi_handedness or [], found.multi_hand_world_landmarks or []):
        # MediaPipe: x to the right, y down, z away from the camera, from the hand's middle [m].
        hands[SIDES[side.classification[0].label]] = {"joints": [[p.x, -p.y, -p.z] for p in points.landmark]}
    if hands:
        to.sendto(json.dumps({"t": t, "hands": hands}).encode(), ("127.0.0.1", int(sys.argv[1])))
