"""Debian's Chromium without a window, with WebGL drawn by the processor (SwiftShader)."""
import shutil

from selenium import webdriver
from selenium.webdriver.chrome.options import Options
from selenium.webdriver.chrome.service import Service

# Waits until two frames have been drawn.
DRAWN = 'const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(() => done()))'


def browser(width=1280, height=900, gl=True):
    options = Options()
    options.binary_location = shutil.which('chromium')
    for flag in ('--headless=new', '--no-sandbox', '--hide-scrollbars', '--disable-dev-shm-usage',
                 *(('--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader') if gl else ('--disable-gpu', '--disable-3d-apis'))):
        options.add_argument(flag)
    options.set_capability('goog:loggingPrefs', {'browser': 'ALL', 'performance': 'ALL'})
    driver = webdriver.Chrome(service=Service(shutil.which('chromedriver')), options=options)
    driver.set_script_timeout(300)
    driver.set_page_load_timeout(300)
    resize(driver, width, height)
    return driver


def resize(driver, width, height):
    """The page's size in pixels; below 500 a telephone's."""
    driver.execute_cdp_cmd('Emulation.setDeviceMetricsOverride',
                           {'width': width, 'height': height, 'deviceScaleFactor': 1, 'mobile': width < 500})
