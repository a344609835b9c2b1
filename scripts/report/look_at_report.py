#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Checks a report in headless Chromium.

The report must load without errors and without requesting anything else, its
controls must work, and nothing may be wider than a phone.

  scripts/report/look_at_report.py REPORT.html [--screenshots FOLDER] [--sections ID...]

Needs Debian's chromium, chromium-driver and python3-selenium."""
import argparse
import base64
import contextlib
import json
import pathlib
import sys
import tempfile

from selenium import webdriver
from selenium.webdriver.chrome.options import Options
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.by import By

DESKTOP = (1100, 800, 1)
PHONE = (390, 844, 2)
SECTIONS = ['s-trajectory', 's-height', 's-error', 's-space', 's-pairs',
            's-examples', 's-histograms', 's-sensors', 's-times', 's-parts',
            's-steps', 's-errors']

failures = []


def check(is_right, what):
    if not is_right:
        failures.append(what)
        print('FAILED: ' + what, file=sys.stderr)


@contextlib.contextmanager
def open_browser():
    options = Options()
    options.binary_location = '/usr/bin/chromium'
    with tempfile.TemporaryDirectory() as profile:
        for argument in ['--headless', '--no-sandbox', '--disable-gpu',
                         '--no-first-run', '--disable-background-networking',
                         '--disable-component-update', '--disable-sync',
                         '--disable-dev-shm-usage', '--hide-scrollbars',
                         '--user-data-dir=' + profile]:
            options.add_argument(argument)
        options.set_capability('goog:loggingPrefs',
                               {'browser': 'ALL', 'performance': 'ALL'})
        browser = webdriver.Chrome(options=options, service=Service(
            '/usr/bin/chromedriver'))
        try:
            yield browser
        finally:
            browser.quit()


def show(browser, report, screen, theme='light', media=''):
    width, height, ratio = screen
    browser.execute_cdp_cmd('Emulation.setDeviceMetricsOverride', {
        'width': width, 'height': height, 'deviceScaleFactor': ratio,
        'mobile': width < 600})
    browser.execute_cdp_cmd('Emulation.setEmulatedMedia', {
        'media': media,
        'features': [{'name': 'prefers-color-scheme', 'value': theme}]})
    browser.get(report.resolve().as_uri())


def check_log(browser, report):
    for entry in browser.get_log('browser'):
        check(False, 'the console says: ' + entry['message'])
    for entry in browser.get_log('performance'):
        message = json.loads(entry['message'])['message']
        if message['method'] != 'Network.requestWillBeSent':
            continue
        url = message['params']['request']['url']
        check(url.startswith('data:') or url == report.resolve().as_uri(),
              'the page asks for ' + url[:200])


def check_layout(browser, name):
    wide, screen = browser.execute_script(
        'return [document.documentElement.scrollWidth, '
        'document.documentElement.clientWidth]')
    check(wide <= screen, '%s: the page is %d px wide on a screen of %d px' %
          (name, wide, screen))
    broken = browser.execute_script(
        'return [...document.querySelectorAll("svg *")].filter((e) => '
        '[...e.attributes].some((a) => a.name !== "href" && '
        '/NaN|Infinity|undefined/.test(a.value)))'
        '.length')
    check(broken == 0, '%s: %d elements of charts have no number' %
          (name, broken))
    blank = browser.execute_script('''
      return [...document.querySelectorAll("canvas")].filter((canvas) =>
        canvas.clientWidth > 0 && !canvas.getContext("2d").getImageData(
          0, 0, canvas.width, canvas.height).data.some((v) => v !== 0))
        .map((canvas) => canvas.id)''')
    check(not blank, '%s: canvas without content: %s' % (name, blank))


def check_sections(browser, expected):
    shown = [section.get_attribute('id')
             for section in browser.find_elements(By.TAG_NAME, 'section')
             if section.is_displayed()]
    for section in expected:
        check(section in shown, 'section %s is not shown' % section)


def picture_of(browser, canvas):
    # Reads the canvas one frame later, when it has been drawn.
    return browser.execute_async_script(
        'requestAnimationFrame(() => requestAnimationFrame(() => '
        'arguments[1](document.getElementById(arguments[0]).toDataURL())))',
        canvas)


def check_layers(browser):
    count = ('return document.querySelectorAll('
             '"#trajectory path, #trajectory circle").length')
    boxes = browser.find_elements(By.CSS_SELECTOR, '#layers input')
    check(boxes, 'the trajectory has no layers')
    for box in boxes:
        before = browser.execute_script(count)
        box.click()
        check(browser.execute_script(count) < before,
              box.get_attribute('id') + ' hides nothing')
        box.click()
        check(browser.execute_script(count) == before,
              box.get_attribute('id') + ' does not come back')


def check_space(browser):
    seen = [picture_of(browser, 'space')]

    def is_new(what):
        picture = picture_of(browser, 'space')
        check(picture not in seen, what + ' does not change the 3D view')
        seen.append(picture)

    for slider, value in [('turn', 40), ('tilt', 70), ('zoom', 45)]:
        browser.execute_script(
            'const s = document.getElementById(arguments[0]); '
            's.value = arguments[1]; s.dispatchEvent(new Event("input"))',
            slider, value)
        is_new(slider)
    canvas = browser.find_element(By.ID, 'space')
    webdriver.ActionChains(browser).drag_and_drop_by_offset(
        canvas, 60, 20).perform()
    is_new('dragging')
    browser.execute_script(
        'document.getElementById("space").dispatchEvent(new WheelEvent('
        '"wheel", {deltaY: -80, ctrlKey: true, cancelable: true}))')
    is_new('the wheel')
    browser.execute_script('''
      const canvas = document.getElementById("space");
      canvas.setPointerCapture = () => {};  // no finger is there to capture
      const touch = (name, id, x) => canvas.dispatchEvent(new PointerEvent(
        name, {pointerId: id, clientX: x, clientY: 50}));
      touch("pointerdown", 91, 100);
      touch("pointerdown", 92, 180);
      touch("pointermove", 92, 120);
      touch("pointerup", 91, 100);
      touch("pointerup", 92, 120);''')
    is_new('pinching')
    canvas.send_keys(webdriver.Keys.ARROW_LEFT)
    is_new('an arrow key')
    browser.find_element(By.ID, 'show-points').click()
    is_new('hiding the points')


def check_theme(browser):
    background = ('return getComputedStyle(document.body).backgroundColor')
    light = browser.execute_script(background)
    browser.find_element(By.ID, 'theme').click()
    check(browser.execute_script(background) != light,
          'the theme button changes nothing')
    browser.find_element(By.ID, 'theme').click()
    check(browser.execute_script(background) == light,
          'the theme does not come back')


def check_examples(browser):
    for kind in ['kept', 'dropped']:
        paths = browser.find_elements(By.CSS_SELECTOR,
                                      '.example path.' + kind)
        if not paths:
            continue
        box = browser.find_element(By.ID, 'show-' + kind)
        check(paths[0].is_displayed(), kind + ' matches are not drawn')
        box.click()
        check(not paths[0].is_displayed(), kind + ' matches cannot be hidden')
        box.click()


def check_pointing(browser):
    # Selenium moves the pointer to the centre of the first circle.
    chart = browser.find_element(By.CSS_SELECTOR, '#trajectory circle')
    webdriver.ActionChains(browser).move_to_element(chart).perform()
    check('Image ' in browser.find_element(By.ID, 'image-status').text,
          'pointing at the line names no image')


def save(browser, path, section=None, max_height=None):
    if section is None:
        clip = browser.execute_script(
            'return {x: 0, y: 0, width: document.documentElement.clientWidth, '
            'height: document.documentElement.scrollHeight, scale: 1}')
    else:
        clip = browser.execute_script(
            'const b = document.getElementById(arguments[0])'
            '.getBoundingClientRect(); return {x: 0, y: b.top + scrollY - 12, '
            'width: document.documentElement.clientWidth, '
            'height: b.height + 24, scale: 1}', section)
    if max_height:
        clip['height'] = min(clip['height'], max_height)
    form = {'format': 'png'}
    if path.suffix == '.jpg':
        form = {'format': 'jpeg', 'quality': 75}
    data = browser.execute_cdp_cmd('Page.captureScreenshot', {
        'clip': clip, 'captureBeyondViewport': True, **form})['data']
    path.write_bytes(base64.b64decode(data))
    print('wrote', path)


def check_report(browser, report, expected):
    # Discards the log entries of the browser's first page.
    browser.get('about:blank')
    browser.get_log('browser'), browser.get_log('performance')
    show(browser, report, DESKTOP)
    check_sections(browser, expected)
    check_layout(browser, 'desktop')
    check_theme(browser)
    check_layers(browser)
    check_pointing(browser)
    check_space(browser)
    check_examples(browser)
    show(browser, report, PHONE)
    check_layout(browser, 'phone')
    show(browser, report, DESKTOP, theme='dark')
    check_layout(browser, 'dark')
    check(browser.execute_script(
        'return document.documentElement.dataset.theme') == 'dark',
        'the browser\'s dark mode is not followed')
    show(browser, report, DESKTOP, theme='dark', media='print')
    check_layout(browser, 'print')
    check(browser.execute_script(
        'return getComputedStyle(document.body).backgroundColor') ==
        'rgb(255, 255, 255)', 'paper is not white')
    check_log(browser, report)


def save_screenshots(browser, report, folder):
    folder.mkdir(parents=True, exist_ok=True)
    show(browser, report, DESKTOP)
    save(browser, folder / 'report_desktop.png', max_height=1350)
    save(browser, folder / 'report_pairs.png', 's-pairs')
    # JPEG, since PNG of photos and points would be ten times as large.
    save(browser, folder / 'report_space.jpg', 's-space')
    save(browser, folder / 'report_examples.jpg', 's-examples', 800)
    show(browser, report, PHONE[:2] + (1.5,))
    save(browser, folder / 'report_phone.png', max_height=1150)
    show(browser, report, DESKTOP, theme='dark')
    save(browser, folder / 'report_dark.png', max_height=1350)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument('report', type=pathlib.Path)
    parser.add_argument('--screenshots', type=pathlib.Path)
    parser.add_argument('--sections', nargs='*', default=SECTIONS,
                        help='sections that must be there; all by default')
    arguments = parser.parse_args()
    with open_browser() as browser:
        check_report(browser, arguments.report, arguments.sections)
        if arguments.screenshots:
            save_screenshots(browser, arguments.report, arguments.screenshots)
    if failures:
        sys.exit(1)
    print('report: ok')


if __name__ == '__main__':
    main()
