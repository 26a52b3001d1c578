"""A live session in headless Chromium, as somebody uses it: plays, pulls, pauses, goes back, saves.

browser_test.py: with handsim on PYTHONPATH. Oracles: what the session has (its course, its recording repeated to the bit), and
what the browser reports (console, requests, pixels).
"""
import json
import pathlib
import sys
import threading
import time
import unittest

from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By

sys.path.insert(0, str(pathlib.Path(__file__).parents[1] / 'report'))
from chromium import DRAWN, browser  # noqa: E402

import handsim as hs  # noqa: E402
from handsim._live.replay import Replay  # noqa: E402

PIXELS = """
const from = document.querySelector('.screen canvas'), copy = document.createElement('canvas');
copy.width = 160; copy.height = 120;
const draw = copy.getContext('2d');
draw.drawImage(from, 0, 0, 160, 120);
return Array.from(draw.getImageData(0, 0, 160, 120).data);
"""
PATIENCE = 60


class Page(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.driver = browser(1400, 1000)

    @classmethod
    def tearDownClass(cls):
        cls.driver.quit()

    def setUp(self):
        self.live = hs.live(hs.load(getattr(self, 'scene', 'two_hands_contact'), engine='articulated'))
        self.session = self.live.session
        self.driver.get_log('browser')
        self.driver.get_log('performance')
        self.driver.get(self.live.url)
        self.until(lambda: self.script('return !!handsimLive.view && handsimLive.views[1] > 0'))

    def tearDown(self):
        self.driver.get('about:blank')
        self.live.close()

    def script(self, text, *words):
        return self.driver.execute_script(text, *words)

    def until(self, found):
        end = time.monotonic() + PATIENCE
        while not found():
            self.assertLess(time.monotonic(), end, 'it did not happen')
            time.sleep(0.05)

    def pixels(self):
        self.driver.execute_async_script(DRAWN)
        return self.script(PIXELS)

    @staticmethod
    def differing(a, b):
        return sum(any(abs(x - y) > 12 for x, y in zip(a[i:i + 4], b[i:i + 4])) for i in range(0, len(a), 4))

    def problems(self):
        return [entry['message'] for entry in self.driver.get_log('browser') if entry['level'] in ('SEVERE', 'WARNING')
                and 'GPU stall' not in entry['message'] and 'GL Driver' not in entry['message']]

    def requests(self):
        events = [json.loads(entry['message'])['message'] for entry in self.driver.get_log('performance')]
        return [event['params']['request']['url'] for event in events if event['method'] == 'Network.requestWillBeSent']

    def canvas(self):
        return self.driver.find_element(By.CSS_SELECTOR, '.screen canvas')

    def click(self, identifier):
        self.driver.find_element(By.ID, identifier).click()

    def drag(self, word, *ways):
        """Drags a body whose name has a word along ways of pixels, a second each, in a thread; returns body and thread."""
        shown = 'return handsimLive.views[0] === handsimLive.views[1] && Math.abs(handsimLive.time - arguments[0]) < 1e-9'
        self.until(lambda: self.script(shown, self.session.course.time))
        found = self.script("""
            handsimLive.view.render();
            const box = document.querySelector('.screen canvas').getBoundingClientRect(), names = arguments[0], word = arguments[1];
            const at = (x, y) => handsimLive.bodyAt(box.left + x, box.top + y);
            for (let y = 20; y < box.height; y += 5) for (let x = 20; x < box.width; x += 5) {
              const body = at(x, y);
              if (body && names[body].includes(word) && [[5, 0], [-5, 0], [0, 5], [0, -5]].every(([dx, dy]) => at(x + dx, y + dy) === body)) return [body, x - box.width / 2, y - box.height / 2];
            }
            return null;""", self.session.facts.bodies, word)
        self.assertTrue(found, f'no {word} in the picture')
        chain = ActionChains(self.driver).move_to_element_with_offset(self.canvas(), round(found[1]), round(found[2])).click_and_hold().pause(1)
        for way in ways:
            chain = chain.move_by_offset(*way).pause(1)
        out = threading.Thread(target=chain.release().perform)
        out.start()
        return found[0], out

    def state(self):
        return self.session.call(lambda session: (session.course.tick, session.course.state_hash())).result(PATIENCE)

    def test_opens_without_a_message_or_a_request_to_others(self):
        own = self.live.url.partition('/?')[0]
        self.click('play')
        self.until(lambda: self.script('return handsimLive.time') > 0.2)
        self.assertEqual(self.problems(), [])
        self.assertEqual([url for url in self.requests() if not url.startswith((own, 'data:', 'blob:', own.replace('http', 'ws')))], [])

    def test_plays_and_pauses(self):
        first = self.pixels()
        self.assertGreater(len({tuple(first[i:i + 4]) for i in range(0, len(first), 4)}), 300)
        self.click('play')
        self.until(lambda: self.script('return handsimLive.time') > 0.6)
        self.assertGreater(self.differing(first, self.pixels()), 100)
        self.click('play')
        self.until(lambda: not self.session.playing)
        at = self.state()
        time.sleep(0.3)
        self.assertEqual(self.state(), at)
        self.click('step')
        self.until(lambda: self.state()[0] == at[0] + 1)

    def test_drags_pauses_rewinds_and_repeats_to_the_bit(self):
        # The camera stands, so that pictures can be compared.
        next(label for label in self.driver.find_elements(By.CSS_SELECTOR, '#layers label') if label.text == 'follow the hands').click()
        self.script("handsimLive.send('pose', {name: 'flat'})")
        self.click('play')
        self.until(lambda: self.script('return handsimLive.time') > 0.3)
        self.click('play')
        self.until(lambda: not self.session.playing)
        held, moving = self.drag('_distal', (-20, -20), (-20, -20), (-10, -20))
        before = self.session.view.poses[held, :3].copy()
        self.until(lambda: self.session.course.controls['springs'])
        self.live.do('play', on=True)
        self.assertEqual(next(iter(self.session.course.controls['springs'].values()))[0], held)
        self.until(lambda: abs(self.session.course.spring_forces).max(initial=0) > 0.05)
        self.until(lambda: abs(self.session.view.poses[held, :3] - before).max() > 0.003)
        moving.join()
        self.until(lambda: not self.session.course.controls['springs'])
        self.assertGreater(len(self.script('return handsimLive.latency')), 0)
        self.click('play')
        self.until(lambda: not self.session.playing)
        present = self.state()
        there = self.pixels()

        slider = self.driver.find_element(By.ID, 'time')
        ActionChains(self.driver).move_to_element_with_offset(slider, -slider.size['width'] // 4, 0).click().perform()
        self.until(lambda: self.session.state['past'])
        self.assertLess(self.state()[0], present[0])
        self.until(lambda: 'before the present' in self.driver.find_element(By.CLASS_NAME, 'past').text)
        self.click('present')
        self.until(lambda: not self.session.state['past'])
        self.assertEqual(self.state(), present)
        self.until(lambda: self.differing(there, self.pixels()) < 20)

        ActionChains(self.driver).move_to_element_with_offset(slider, -slider.size['width'] // 4, 0).click().perform()
        self.until(lambda: self.session.state['past'])
        back = self.state()[0]
        self.click('play')
        self.until(lambda: self.session.course.tick > back + 200)
        self.click('play')
        self.until(lambda: not self.session.playing)
        tick, end = self.state()
        found = Replay(self.session.call(lambda session: session.history.recording()).result(PATIENCE))
        found.run()
        self.assertEqual((found.course.tick, found.course.state_hash()), (tick, end))
        self.assertEqual(self.problems(), [])

    def test_a_drag_beside_bodies_turns_the_camera(self):
        first = self.pixels()
        canvas = self.canvas()
        ActionChains(self.driver).move_to_element_with_offset(canvas, -canvas.size['width'] // 2 + 20, 0).click_and_hold().move_by_offset(90, 20).release().perform()
        self.assertGreater(self.differing(first, self.pixels()), 300)
        self.assertEqual(self.session.course.controls['springs'], {})

    def test_a_driven_wrist_is_moved(self):
        _, moving = self.drag('.palm', (60, 0))
        self.until(lambda: self.session.course.controls['wrists'] is not None)
        moving.join()

    def test_poses_gravity_and_speed(self):
        self.driver.find_element(By.CSS_SELECTOR, '[data-pose=claw]').click()
        self.until(lambda: self.session.course.controls['targets'] is not None)
        gravity = self.driver.find_element(By.CSS_SELECTOR, 'input[aria-label="gravity, z"]')
        self.script("arguments[0].value = 0; arguments[0].dispatchEvent(new Event('input'))", gravity)
        self.until(lambda: self.session.course.controls['numbers'].get('gravity') == [0.0, 0.0, 0.0])
        speed = self.driver.find_element(By.CSS_SELECTOR, 'select[aria-label=speed]')
        self.script("arguments[0].value = 0.5; arguments[0].dispatchEvent(new Event('change'))", speed)
        self.until(lambda: self.session.speed == 0.5)

    def test_another_person_and_engine_are_built_while_it_runs(self):
        self.click('play')
        field = self.driver.find_element(By.CSS_SELECTOR, 'input[aria-label=stature]')
        self.assertEqual(float(field.get_attribute('value')), 1.755)
        self.script("arguments[0].value = 1.95; arguments[0].dispatchEvent(new Event('change'))", field)
        self.until(lambda: self.session.state['overrides'].get('hands.0.person.stature') == 1.95)
        self.until(lambda: self.script('return !!handsimLive.view && handsimLive.view.bodies.length') == len(self.session.facts.bodies))
        engine = self.driver.find_element(By.CSS_SELECTOR, 'select[aria-label=engine]')
        self.script("arguments[0].value = 'ode'; arguments[0].dispatchEvent(new Event('change'))", engine)
        self.until(lambda: self.session.state['engine'] == 'ode')
        self.until(lambda: self.script('return !!handsimLive.view && handsimLive.views[1] > 0'))
        self.until(lambda: 'ode' in self.driver.find_element(By.ID, 'status').text)
        self.assertEqual(self.problems(), [])

    def test_verdicts_and_curves_grow(self):
        self.click('play')
        self.until(lambda: len(self.driver.find_elements(By.CSS_SELECTOR, '.panel tbody tr')) > 3)
        self.assertIn('penetration', self.driver.find_element(By.CSS_SELECTOR, '.panel').text)
        canvas = self.driver.find_element(By.CSS_SELECTOR, '.plot canvas')
        pixels = "const c = arguments[0], d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; let n = 0; for (let i = 0; i < d.length; i += 4) n += d[i + 3] > 0 && Math.max(d[i], d[i + 1], d[i + 2]) - Math.min(d[i], d[i + 1], d[i + 2]) > 60; return n"
        self.until(lambda: self.script(pixels, canvas) > 20)

    def test_a_wrong_wish_is_told(self):
        self.script("handsimLive.send('scene', {stature: 99})")
        self.until(lambda: 'stature' in self.driver.find_element(By.CLASS_NAME, 'notice').text)

    def test_a_hostile_title_does_nothing(self):
        self.driver.get('about:blank')
        self.live.close()
        title = '</script><script>window.hostile=1</script><img src=x onerror="window.hostile=1">'
        self.live = hs.live('two_hands_contact', {'title': title})
        self.session = self.live.session
        self.driver.get(self.live.url)
        self.until(lambda: self.script('return !!handsimLive.view'))
        self.assertIsNone(self.script('return window.hostile ?? null'))


if __name__ == '__main__':
    unittest.main(verbosity=2)
