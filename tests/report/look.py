#!/usr/bin/python3
"""Looks at a page as a reader sees it: a picture of it, or how long it takes.

look.py PAGE --picture OUT.png [--width 1280] [--height 900] [--time T] [--script JAVASCRIPT] [--whole]
look.py PAGE... --measure          size, time and CPU time to load until two frames are drawn, time of a frame at 1280 x 720
"""
import argparse
import os
import pathlib
import time

from chromium import DRAWN, browser, resize

FULL = "Object.assign(document.querySelector('.screen').style, {position: 'fixed', left: 0, top: 0, width: '1280px', height: '720px', zIndex: 9})"


def cpu_time(root):
    """CPU seconds of a process and its children."""
    table = {}
    for entry in pathlib.Path('/proc').glob('[0-9]*/stat'):
        try:
            fields = entry.read_text().rsplit(')', 1)[1].split()
        except OSError:
            continue
        table[int(entry.parent.name)] = (int(fields[1]), int(fields[11]) + int(fields[12]))

    def below(pid):
        return table.get(pid, (0, 0))[1] + sum(below(child) for child, (parent, _) in table.items() if parent == pid)
    return below(root) / os.sysconf('SC_CLK_TCK')


def measure(driver, page, frames=10):
    begin, before = time.perf_counter(), cpu_time(driver.service.process.pid)
    driver.get(page.as_uri())
    driver.execute_async_script(DRAWN)
    load, cpu = time.perf_counter() - begin, cpu_time(driver.service.process.pid) - before
    text = f'{page}: {page.stat().st_size / 1e6:.2f} MB, loads in {load:.2f} s ({cpu:.2f} s of CPU time)'
    if driver.execute_script('return !!handsimReport.view'):
        driver.execute_script(FULL)
        driver.execute_async_script(DRAWN)
        driver.execute_script('handsimReport.view.measure(2)')
        before = cpu_time(driver.service.process.pid)
        frame = driver.execute_script('return handsimReport.view.measure(arguments[0])', frames)
        cpu = 1e3 * (cpu_time(driver.service.process.pid) - before) / frames
        text += f', a frame takes {frame:.1f} ms ({1e3 / frame:.0f} a second), {cpu:.1f} ms of CPU time'
    print(text)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('pages', nargs='+', type=pathlib.Path)
    parser.add_argument('--picture', type=pathlib.Path)
    parser.add_argument('--width', type=int, default=1280)
    parser.add_argument('--height', type=int, default=900)
    parser.add_argument('--time', type=float)
    parser.add_argument('--script', help='run before the picture')
    parser.add_argument('--whole', action='store_true', help='the page down to its end')
    parser.add_argument('--measure', action='store_true')
    arguments = parser.parse_args()
    pages = [page.resolve() for page in arguments.pages]
    driver = browser(arguments.width, arguments.height)
    try:
        if arguments.measure:
            for page in pages:
                measure(driver, page)
            return
        # With smoothed edges and shadows, as a graphics card draws it.
        driver.get(pages[0].as_uri() + '#fine')
        if arguments.time is not None:
            driver.execute_script('handsimReport.seek(arguments[0])', arguments.time)
        if arguments.script:
            driver.execute_script(arguments.script)
        if arguments.whole:
            resize(driver, arguments.width, driver.execute_script('return document.documentElement.scrollHeight'))
        time.sleep(0.3)
        driver.execute_async_script(DRAWN)
        driver.save_screenshot(str(arguments.picture))
    finally:
        driver.quit()


if __name__ == '__main__':
    main()
