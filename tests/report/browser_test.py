"""The pages in headless Chromium, opened from the disk as a reader opens them.

browser_test.py HANDSIM SOURCE FOLDER: writes pages with the program into FOLDER and tests them. Oracles: what the browser
reports (console, requests, pixels), and figures of summary.json.
"""
import json
import pathlib
import shutil
import subprocess
import sys
import time
import unittest

from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from chromium import DRAWN, browser, resize

handsim, source, folder = (pathlib.Path(word).resolve() for word in sys.argv[1:4])
HOSTILE = '</script><script>window.hostile=1</script><img src=x onerror="window.hostile=1">'
# Differing pixels of two drawings of the view, and its number of colours.
PIXELS = """
const from = document.querySelector('.screen canvas'), copy = document.createElement('canvas');
copy.width = 160; copy.height = 120;
const draw = copy.getContext('2d');
draw.drawImage(from, 0, 0, 160, 120);
return Array.from(draw.getImageData(0, 0, 160, 120).data);
"""


def run(*words, status=(0,)):
    done = subprocess.run([handsim, *map(str, words)], capture_output=True, text=True, cwd=source)
    if done.returncode not in status:
        raise AssertionError(f"{words}: status {done.returncode}: {done.stdout}{done.stderr}")
    return done


def write_pages():
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    scene = 'config/two_hands.yaml'
    short = ('--set', 'duration=0.4 s', '--set', 'record.every=2 ms', '--quiet')
    run('run', scene, '--out', folder / 'a', '--report', *short)
    run('run', scene, '--out', folder / 'b', '--report', *short, '--set', 'gravity=[0, 0, -3]')
    run('run', scene, '--out', folder / 'failed', '--report', *short, '--set', 'criteria.joint_gap=1e-9', status=(1,))
    run('run', 'config/dropped_hand.yaml', '--out', folder / 'dropped', '--report', '--quiet', '--set', 'duration=0.5 s', status=(0, 1))
    run('run', 'config/dropped_hand.yaml', '--out', folder / 'followed', '--report', '--quiet', '--set', 'duration=2 s', '--set',
        'pictures.follow=true', status=(0, 1))
    run('report', folder / 'a', folder / 'b', '--out', folder / 'both.html')
    run('run', 'config/muscle_poses.yaml', '--out', folder / 'muscles', '--report', '--quiet', '--set', 'duration=0.3 s', status=(0, 1))
    run('run', scene, '--out', folder / 'hostile', '--report', *short, '--set', 'title=' + HOSTILE)
    run('inverse', 'config/every_pose.yaml', '--out', folder / 'bands', '--report', '--uncertain', 4, '--set', 'duration=0.5 s')
    run('effects', scene, '--out', folder / 'effects', '--report', '--repeats', 1, '--set', 'duration=0.02 s', '--set', 'title=' + HOSTILE)


class Pages(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        write_pages()
        cls.driver = browser()

    @classmethod
    def tearDownClass(cls):
        cls.driver.quit()

    def open(self, name):
        self.driver.get_log('browser')
        self.driver.get_log('performance')
        self.driver.get((folder / name).as_uri())
        self.drawn()

    def drawn(self):
        self.driver.execute_async_script(DRAWN)

    def script(self, text, *words):
        return self.driver.execute_script(text, *words)

    def pixels(self):
        self.drawn()
        return self.script(PIXELS)

    def differing(self, a, b):
        return sum(any(abs(x - y) > 12 for x, y in zip(a[i:i + 4], b[i:i + 4])) for i in range(0, len(a), 4))

    def problems(self):
        return [entry['message'] for entry in self.driver.get_log('browser') if entry['level'] in ('SEVERE', 'WARNING')
                and 'GPU stall' not in entry['message'] and 'GL Driver' not in entry['message']]

    def requests(self):
        events = [json.loads(entry['message'])['message'] for entry in self.driver.get_log('performance')]
        urls = [event['params']['request']['url'] for event in events if event['method'] == 'Network.requestWillBeSent']
        return [url for url in urls if not url.startswith(('data:', 'blob:'))]

    def test_loads_from_the_disk_without_a_message_or_another_request(self):
        for name in ('a/report.html', 'dropped/report.html', 'both.html', 'effects/report.html'):
            self.open(name)
            self.assertEqual(self.problems(), [], name)
            self.assertEqual(self.requests(), [(folder / name).as_uri()], name)

    def test_the_main_scene_takes_less_than_3_MB(self):
        self.assertLess((folder / 'a/report.html').stat().st_size, 3e6)

    def test_the_view_is_not_blank_and_moves_with_the_time(self):
        self.open('a/report.html')
        first = self.pixels()
        colours = {tuple(first[i:i + 4]) for i in range(0, len(first), 4)}
        self.assertGreater(len(colours), 500)
        self.script('handsimReport.seek(0.3)')
        later = self.pixels()
        self.assertGreater(self.differing(first, later), 200)
        self.script('handsimReport.seek(0)')
        self.assertEqual(self.differing(first, self.pixels()), 0)

    def test_the_slider_scrubs(self):
        self.open('a/report.html')
        slider = self.driver.find_element(By.ID, 'time')
        ActionChains(self.driver).move_to_element(slider).click().perform()
        self.assertAlmostEqual(self.script('return handsimReport.state.time'), 0.2, delta=0.01)

    def test_keys_step_and_play(self):
        self.open('a/report.html')
        body = self.driver.find_element(By.TAG_NAME, 'body')
        body.send_keys(Keys.ARROW_RIGHT, Keys.ARROW_RIGHT)
        self.assertAlmostEqual(self.script('return handsimReport.state.time'), 0.004, delta=1e-9)
        body.send_keys(Keys.END)
        self.assertAlmostEqual(self.script('return handsimReport.state.time'), 0.4, delta=1e-6)
        body.send_keys(Keys.HOME)
        body.send_keys(' ')
        end = time.time() + 60
        while self.script('return handsimReport.state.time') <= 0 and time.time() < end:
            self.drawn()
        self.assertGreater(self.script('return handsimReport.state.time'), 0)

    def test_a_verdict_link_goes_to_its_time_and_picks_its_body(self):
        summary = json.loads((folder / 'a/summary.json').read_text())
        gap = next(c for c in summary['criteria'] if c['name'] == 'joint_gap')
        self.open('a/report.html')
        link = self.driver.find_element(By.CSS_SELECTOR, '#verdicts button.link')
        self.assertIn(gap['where'], link.text)
        link.click()
        self.assertAlmostEqual(self.script('return handsimReport.state.time'), gap['time_s'], delta=1e-9)
        # The child of right.middle_dip is right.middle_distal.
        picked = self.script('return handsimReport.data.runs[0].scene.bodies[handsimReport.view.picked()].name')
        self.assertEqual(picked.split('_')[0], gap['where'].split('_')[0])
        self.assertIn(picked, self.driver.find_element(By.CLASS_NAME, 'label').text)

    def test_a_click_on_a_curve_goes_to_its_time(self):
        self.open('a/report.html')
        canvas = self.driver.find_element(By.CSS_SELECTOR, '.plot canvas')
        ActionChains(self.driver).move_to_element_with_offset(canvas, 0, 0).click().perform()
        # The plot has 52 pixels to its left and 10 to its right: the middle of the canvas is 21 left of its own.
        width = canvas.size['width'] - 62
        self.assertAlmostEqual(self.script('return handsimReport.state.time'), 0.4 * (0.5 - 21 / width), delta=0.01)

    def test_a_click_picks_a_body(self):
        self.open('a/report.html')
        canvas = self.driver.find_element(By.CSS_SELECTOR, '.screen canvas')
        picked = None
        for x in range(-300, 300, 30):
            ActionChains(self.driver).move_to_element_with_offset(canvas, x, -60).click().perform()
            picked = self.script('return handsimReport.view.picked()')
            if picked is not None:
                break
        self.assertIsNotNone(picked)
        self.assertRegex(self.driver.find_element(By.CLASS_NAME, 'label').text, r'(kg|g|driven), .* m/s')

    def test_dragging_orbits_and_the_key_r_returns(self):
        self.open('a/report.html')
        first = self.pixels()
        canvas = self.driver.find_element(By.CSS_SELECTOR, '.screen canvas')
        ActionChains(self.driver).drag_and_drop_by_offset(canvas, 120, 30).perform()
        self.assertGreater(self.differing(first, self.pixels()), 500)
        canvas.send_keys('r')
        self.assertEqual(self.differing(first, self.pixels()), 0)

    # Chromium draws with the processor here; #fine draws as a graphics card does.
    def test_a_picture_that_moves_has_fewer_pixels_than_one_that_stands(self):
        width = "return document.querySelector('.screen canvas').width"
        for page, fewer in (('a/report.html', True), ('a/report.html#fine', False)):
            self.driver.get('about:blank')
            self.driver.get(folder.as_uri() + '/' + page)
            self.drawn()
            still = self.script(width)
            # Slowly, so that it still plays when a busy machine asks.
            self.script("const s = document.querySelector('select[aria-label=speed]'); s.value = 0.01; s.dispatchEvent(new Event('change'))")
            self.driver.find_element(By.ID, 'play').click()
            self.assertEqual(self.script(width) < 0.75 * still, fewer, page)
            self.script("document.getElementById('play').click()")
            self.assertEqual(self.script(width), still, page)

    def test_a_failed_verdict_is_marked_on_the_time_line(self):
        self.open('failed/report.html')
        marks = self.driver.find_elements(By.CSS_SELECTOR, '.marks button.failed')
        self.assertEqual(len(marks), 1)
        self.assertIn('joint_gap', marks[0].get_attribute('aria-label'))
        marks[0].click()
        self.assertGreater(self.script('return handsimReport.state.time'), 0)
        self.open('a/report.html')
        self.assertEqual(self.driver.find_elements(By.CSS_SELECTOR, '.marks button.failed'), [])

    def test_contacts_are_drawn_and_can_be_hidden(self):
        self.open('dropped/report.html')
        self.script('handsimReport.seek(0.5)')
        self.assertGreater(self.script("return handsimReport.view.contactsOf(0).length"), 0)
        shown = self.pixels()
        self.driver.find_element(By.TAG_NAME, 'body').send_keys('c', 'f')
        self.assertGreater(self.differing(shown, self.pixels()), 5)

    def test_the_camera_follows_the_hand(self):
        self.open('followed/report.html')
        where = """const palm = handsimReport.data.runs[0].scene.bodies.findIndex(b => b.name.endsWith('palm'));
            handsimReport.seek(arguments[0]); handsimReport.view.render(); return handsimReport.view.onScreen(palm)[1]"""
        self.script(where, 0)
        followed = self.script(where, 2)
        labels = [label for label in self.driver.find_elements(By.CSS_SELECTOR, '#layers label') if label.text == 'follow the hand']
        self.script(where, 0)
        labels[0].click()
        # The first half second has the fall; the camera that follows frames the hand on the ground afterwards.
        self.assertLess(abs(followed), 0.5)
        self.assertGreater(followed - self.script(where, 2), 0.1)

    def test_curves_have_the_colours_of_their_fingers(self):
        self.open('a/report.html')
        thumb = [label for label in self.driver.find_elements(By.CSS_SELECTOR, '#layers label') if label.text == 'thumb'][0]
        swatch = self.script("return getComputedStyle(arguments[0].querySelector('.swatch')).backgroundColor", thumb)
        line = self.script("return getComputedStyle([...document.querySelectorAll('.plot .keys button')]"
                           ".find(b => b.textContent.includes('thumb_ip')).querySelector('i')).borderTopColor")
        self.assertEqual(swatch, line)

    def test_parts_can_be_hidden(self):
        self.open('a/report.html')
        first = self.pixels()
        labels = [label for label in self.driver.find_elements(By.CSS_SELECTOR, '#layers label') if label.text == 'palm']
        self.assertEqual(len(labels), 1)
        labels[0].click()
        self.assertGreater(self.differing(first, self.pixels()), 200)

    # Oracle: pixels; the shapes' own colours, which skin hides and glass mixes; Hand.mesh's triangles in the page.
    def test_a_key_shows_skin_shapes_or_both(self):
        self.open('a/report.html')
        self.assertEqual(self.script('return handsimReport.view.look()'), 'skin')
        seen = [self.pixels()]
        for look in ('shapes', 'both', 'skin'):
            self.driver.find_element(By.TAG_NAME, 'body').send_keys('s')
            self.assertEqual(self.script('return handsimReport.view.look()'), look)
            seen.append(self.pixels())
        for one, other in ((0, 1), (1, 2), (2, 3)):
            self.assertGreater(self.differing(seen[one], seen[other]), 300)
        self.assertEqual(self.differing(seen[0], seen[3]), 0)
        self.driver.find_element(By.TAG_NAME, 'body').send_keys('n')
        self.assertGreater(self.differing(seen[0], self.pixels()), 300)
        self.open('dropped/report.html')
        self.assertIn('contact is with the shapes', self.driver.find_element(By.CLASS_NAME, 'legend3d').text)

    # Oracle: where the shapes' capsules are, to which the skin has at most 1 mm at fingertips.
    def test_skin_is_where_the_bodies_are(self):
        self.open('a/report.html')
        gap = """handsimReport.seek(arguments[0]);
            const {scene} = handsimReport.data.runs[0], tip = scene.tips.find(t => t.part === arguments[1] && t.hand === arguments[2]);
            return handsimReport.view.skinGap(tip.body, tip.point)"""
        for time in (0, 0.2, 0.4):
            for finger in ('thumb', 'index', 'little'):
                for hand in ('right', 'left'):
                    self.assertLess(self.script(gap, time, finger, hand), 0.002, (time, finger, hand))

    def test_of_two_runs_the_second_is_a_ghost(self):
        self.open('both.html')
        self.script('handsimReport.seek(0.3)')
        both = self.pixels()
        self.driver.find_element(By.TAG_NAME, 'body').send_keys('g')
        one = self.pixels()
        self.assertGreater(self.differing(both, one), 100)
        self.assertIn('other run', self.driver.find_element(By.ID, 'verdicts').text)

    def test_hostile_texts_do_nothing(self):
        for name in ('hostile/report.html', 'effects/report.html'):
            self.open(name)
            self.assertIsNone(self.script('return window.hostile ?? null'), name)
            self.assertEqual(self.driver.title, HOSTILE, name)
            self.assertIn(HOSTILE, self.driver.find_element(By.TAG_NAME, 'h1').text, name)
            self.assertEqual(self.script("return document.querySelectorAll('img').length"), 0, name)

    def test_a_study_sorts_filters_and_shows_the_command_of_a_row(self):
        self.open('effects/report.html')
        column = "return [...document.querySelectorAll('.study tbody tr')].map(row => row.cells[0].textContent)"
        names = self.script(column)
        self.assertIn('gravity', names)
        head = self.driver.find_element(By.CSS_SELECTOR, '.study th button')
        head.click()
        self.assertEqual(self.script(column), sorted(names))
        head.click()
        self.assertEqual(self.script(column), sorted(names, reverse=True))
        self.driver.find_element(By.CSS_SELECTOR, 'input[type=search]').send_keys('grav')
        self.assertEqual(self.script(column), ['gravity'])
        self.driver.find_element(By.CSS_SELECTOR, '.study tbody tr').click()
        command = self.driver.find_element(By.CSS_SELECTOR, 'main code').text
        self.assertTrue(command.startswith('handsim run config/two_hands.yaml'), command)
        self.assertIn('effects=[joint_stops, passive_tissue]', command)

    def test_drawn_hands_have_bands_around_their_curves(self):
        """Oracle: the first row of bands.csv; pixels of a band are lighter than its curve and not white."""
        self.open('bands/report.html')
        titles = self.script("return [...document.querySelectorAll('#bands h3')].map(e => e.textContent)")
        self.assertIn('right index (N m)', titles)
        with open(folder / 'bands/bands.csv') as file:
            row = dict(zip(file.readline().strip().split(','), map(float, file.readline().split(','))))
        low, middle, high = (row[f'right.index_pip.flexion.torque.p{p}[N_m]'] for p in (5, 50, 95))
        key = self.script("return [...document.querySelectorAll('#bands .keys button')].map(b => b.textContent).find(t => t.startsWith('index_pip'))")
        shown = [float(word.strip('()')) for word in key.replace('index_pip.flexion', '').replace(' to ', ' ').split()]
        for found, value in zip(shown, (middle, low, high), strict=True):
            self.assertAlmostEqual(found, value, delta=5e-3 * abs(value))
        grey = self.script("""
            const plot = [...document.querySelectorAll('#bands .plot')].find(p => p.querySelector('h3').textContent.startsWith('right index'));
            const canvas = plot.querySelector('canvas'), draw = canvas.getContext('2d'), data = draw.getImageData(0, 0, canvas.width, canvas.height).data;
            let count = 0;
            for (let i = 0; i < data.length; i += 4) if (data[i + 3] > 20 && data[i + 3] < 100) ++count;
            return count / (canvas.width * canvas.height);""")
        self.assertGreater(grey, 0.02)

    def test_no_page_is_wider_than_the_window(self):
        for width in (1280, 390):
            resize(self.driver, width, 844)
            for name in ('a/report.html', 'both.html', 'dropped/report.html', 'effects/report.html', 'bands/report.html'):
                self.open(name)
                self.script("document.querySelectorAll('details').forEach(d => d.open = true)")
                self.assertLessEqual(self.script('return document.documentElement.scrollWidth'), width, name)
        resize(self.driver, 1280, 900)

    def test_muscles_have_plots_by_finger(self):
        self.open('muscles/report.html')
        titles = "return [...document.querySelectorAll('.plot:not([hidden]) h3')].map(e => e.textContent)"
        shown = self.script(titles)
        for title in ('Activations, thumb', 'Tensions, index (N)', 'Tensions, thumb (N)'):
            self.assertIn(title, shown)
        self.assertNotIn('Torques (N m)', shown)
        names = self.script("return [...document.querySelector('.plot').querySelectorAll('.keys button')].map(e => e.textContent)")
        self.assertTrue(all('flexion' in name or 'abduction' in name for name in names), names)
        self.script("const s = document.querySelector('.plots select'); s.value = 'index'; s.dispatchEvent(new Event('change'))")
        shown = self.script(titles)
        self.assertIn('Tensions, index (N)', shown)
        self.assertNotIn('Activations, thumb', shown)
        self.assertEqual(self.problems(), [])

    def test_no_area_under_the_view_is_empty(self):
        for name in ('a/report.html', 'dropped/report.html', 'muscles/report.html'):
            self.open(name)
            view, stage = self.script("return ['.view', '.stage'].map(s => document.querySelector(s).getBoundingClientRect().bottom)")
            self.assertAlmostEqual(view, stage, delta=2, msg=name)

    def test_every_control_has_a_name(self):
        for name in ('both.html', 'effects/report.html'):
            self.open(name)
            nameless = self.script("""return [...document.querySelectorAll('button, select, input, canvas[tabindex]')].filter(e =>
                !(e.getAttribute('aria-label') || e.textContent.trim() || (e.closest('label') && e.closest('label').textContent.trim()))).map(e => e.outerHTML)""")
            self.assertEqual(nameless, [], name)


class WithoutWebGl(unittest.TestCase):
    def test_curves_and_verdicts_are_there(self):
        driver = browser(gl=False)
        try:
            driver.get((folder / 'a/report.html').as_uri())
            driver.execute_async_script(DRAWN)
            self.assertIn('no WebGL', driver.find_element(By.CLASS_NAME, 'screen').text)
            self.assertIn('joint_gap', driver.find_element(By.ID, 'verdicts').text)
            driver.find_element(By.CSS_SELECTOR, '#verdicts button.link').click()
            self.assertGreater(driver.execute_script('return handsimReport.state.time'), 0)
        finally:
            driver.quit()


if __name__ == '__main__':
    unittest.main(argv=[sys.argv[0], *sys.argv[4:]], verbosity=2)
