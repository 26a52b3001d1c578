#!/usr/bin/python3
"""The picture of docs/live.md: a lifted can that is pulled, in the page of its session.

look.py OUT.png [--width 1400] [--height 900] [--scene NAME] [--time 2.6]; with handsim on PYTHONPATH
"""
import argparse
import pathlib
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).parents[1] / 'report'))
from chromium import DRAWN, browser  # noqa: E402

import handsim as hs  # noqa: E402


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('out')
    parser.add_argument('--width', type=int, default=1400)
    parser.add_argument('--height', type=int, default=900)
    parser.add_argument('--scene', default='grasp_power_can')
    parser.add_argument('--time', type=float, default=2.6)
    parser.add_argument('--no-pull', action='store_true')
    words = parser.parse_args()
    with hs.live(hs.load(words.scene, engine='articulated')) as live:
        driver = browser(words.width, words.height)
        driver.get(live.url)
        live.do('play', on=True)
        while live.session.course.time < words.time:
            time.sleep(0.02)
        if not words.no_pull:
            facts = live.session.facts
            body = facts.bodies.index(facts.objects[0])
            place = live.session.view.poses[body, :3]
            goal = [float(place[0]) + 0.05, float(place[1]) - 0.02, float(place[2]) + 0.08]
            live.do('spring', id=0, body=body, point=[0, 0, 0.03], goal=goal, force=10)
            driver.execute_script('handsimLive.view.select(arguments[0])', body)
            time.sleep(1)
        live.do('play', on=False)
        time.sleep(1)
        driver.execute_async_script(DRAWN)
        time.sleep(1)
        driver.save_screenshot(words.out)
        driver.quit()


if __name__ == '__main__':
    main()
