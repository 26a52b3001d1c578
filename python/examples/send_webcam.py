#!/usr/bin/python3
"""Sends the hands that a webcam sees to handsim live, by MediaPipe. UNTESTED here: its model comes from the network.

    pip install mediapipe opencv-python
    handsim live grasp_power_can --engine articulated --play --stream 'udp://127.0.0.1:5005?up=y'
    python3 python/examples/send_webcam.py 5005
"""
import json
import socket
import sys
import time

import cv2
import mediapipe

to = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
camera = cv2.VideoCapture(0)
tracker = mediapipe.solutions.hands.Hands(max_num_hands=2, model_complexity=1)
while True:
    ok, picture = camera.read()
    found = tracker.process(cv2.cvtColor(cv2.flip(picture, 1), cv2.COLOR_BGR2RGB)) if ok else None
    hands = {}
    for side, points in zip(found.multi_handedness or [], found.multi_hand_world_landmarks or []) if found else ():
        # MediaPipe: x to the right, y down, z away from the camera, from the hand's middle [m].
        hands[side.classification[0].label.lower()] = {"joints": [[p.x, -p.y, -p.z] for p in points.landmark]}
    if hands:
        to.sendto(json.dumps({"t": time.time(), "hands": hands}).encode(), ("127.0.0.1", int(sys.argv[1])))
