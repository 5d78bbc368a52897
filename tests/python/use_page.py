"""Uses pages in a headless browser as a person would, and writes what they did as JSON on stdout.

    use_page.py step STEP.js FOLDER...      runs network.json of each folder along its samples.json, into browser.json
    use_page.py drag PAGE                   drags the initial state, then runs every learned state without noise
    use_page.py live URL                    watches a training: what is drawn, and who is answered
    use_page.py view PAGE RECORDING BODY    plays the page to its end; where the body is drawn, and where the recording has it

The browser is found as look_at_page.py finds it; without one the code is 3. A request, an error or a word on the console ends with 1.
"""

import json
import pathlib
import sys

from playwright.sync_api import sync_playwright

from look_at_page import launch


def opened(browser, file, problems):
    """A page from a file, watched."""
    page = browser.new_page(viewport={"width": 1000, "height": 900})
    url = file.resolve().as_uri()
    page.on("request", lambda request: None if request.url == url or request.url.startswith("data:") else problems.append(request.url))
    # A test that reads pixels makes a driver say that this is slow.
    page.on("console", lambda message: None if "GL Driver Message" in message.text else problems.append(f"console: {message.text}"))
    page.on("pageerror", lambda error: problems.append(f"error: {error}"))
    page.goto(url)
    return page


def wait(page, condition, seconds=120):
    """Until something holds; the page's policy forbids the browser's own way."""
    for _ in range(10 * seconds):
        if page.evaluate(condition):
            return
        page.wait_for_timeout(100)
    raise TimeoutError(condition)


def step(browser, script, folders):
    page = browser.new_page()
    page.add_script_tag(content=pathlib.Path(script).read_text(encoding="utf-8"))
    for folder in map(pathlib.Path, folders):
        network = json.loads((folder / "network.json").read_text(encoding="utf-8"))
        samples = json.loads((folder / "samples.json").read_text(encoding="utf-8"))
        # What is infinite is missing as well.
        samples = [[value if isinstance(value, (int, float)) else None for value in sample] for sample in samples]
        run = """([network, samples]) => {
            const net = scrnnStep(network), state = net.begin();
            return samples.map((sample) => { const { mean, variance } = net.step(state, sample); return [mean, variance || []]; });
        }"""
        found = page.evaluate(run, [network, samples])
        flat = [[value for row in found for value in row[part]] for part in (0, 1)]
        (folder / "browser.json").write_text(json.dumps({"mean": flat[0], "variance": flat[1]}), encoding="utf-8")
    return {"folders": len(folders)}


def drag(browser, file, problems):
    page = opened(browser, file, problems)
    runs = page.evaluate("""() => {
        const { data, run } = scrnnPlayground;
        return data.plane.points.map((_, k) => run({ internal: data.plane.internals[k], first: data.plane.begins[k], noise: false, push: 0 }));
    }""")
    orbit = lambda: page.evaluate("document.querySelector('#playground .time .own').getAttribute('points')")
    before, start = orbit(), page.evaluate("[...scrnnPlayground.state.at]")
    handle = page.locator("#playground .handle")
    handle.scroll_into_view_if_needed()
    box = handle.bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] - 60, box["y"] - 45, steps=5)
    page.mouse.up()
    dragged, after = page.evaluate("[...scrnnPlayground.state.at]"), orbit()
    handle.press("ArrowRight")
    keyed = page.evaluate("[...scrnnPlayground.state.at]")
    page.locator("#playground .noise").check()
    noisy = orbit()
    page.locator("#playground .push").evaluate("node => { node.value = 80; node.dispatchEvent(new Event('input')); }")
    return {
        "names": page.evaluate("scrnnPlayground.data.plane.names"), "runs": runs, "start": start, "dragged": dragged, "keyed": keyed,
        "changed": [before != after, after != noisy, noisy != orbit()],
    }


def place_at_the_end(recording, body):
    """Where the recording has the first primitive of a body at last, in the world."""
    from mcap.reader import make_reader
    from mcap_protobuf.decoder import DecoderFactory

    found = None
    with open(recording, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages(topics=["/scene"]):
            for entity in message.entities:
                if entity.id == body:
                    form = "sphere" if entity.spheres else "cylinder" if entity.cylinders else "box"
                    one = (list(entity.spheres) + list(entity.cylinders) + list(entity.cubes))[0]
                    at = one.pose.position
                    found = form, len(entity.spheres), [at.x, at.y, at.z]
    return found


def view(browser, file, recording, body, problems):
    page = opened(browser, file, problems)
    page.locator("#view .speed").select_option("20")
    page.locator("#view .play").click()
    wait(page, "!scrnnView.playing() && scrnnView.time() >= scrnnView.data.length")
    form, spheres, place = place_at_the_end(recording, body)
    projected = page.evaluate("place => scrnnView.project(place)", place)
    # Of a body's pieces the first is measured, alone.
    own = page.evaluate("([body, form]) => scrnnView.bodies.find(one => one.name === body && one.form === form).places.length / 7", [body, form])
    drawn = page.evaluate("""([body, form]) => {
        const first = scrnnView.bodies.find(one => one.name === body && one.form === form);
        const name = first.name;
        first.name = "measured";
        const found = scrnnView.measure("measured");
        first.name = name;
        return found;
    }""", [body, form])
    moved = page.evaluate("() => { const a = scrnnView.project([0, 0, 0]); return a; }")
    box = page.locator("#view .world").bounding_box()
    page.mouse.move(box["x"] + 100, box["y"] + 100)
    page.mouse.down()
    page.mouse.move(box["x"] + 200, box["y"] + 130)
    page.mouse.up()
    turned = page.evaluate("scrnnView.project([0, 0, 0])")
    return {
        "length": page.evaluate("scrnnView.data.length"), "time": page.evaluate("scrnnView.time()"), "pictures": own,
        "projected": projected, "drawn": drawn, "turned": moved != turned, "bodies": page.evaluate("scrnnView.bodies.length"),
        "curves": page.locator("#view .signals svg").count(), "marks": page.locator("#view .marks line").count(),
        "canvas": [box["width"], box["height"]],
    }


def live(browser, url, problems):
    page = browser.new_page()
    asked = []
    page.on("request", lambda request: asked.append(request.url))
    page.on("pageerror", lambda error: problems.append(f"error: {error}"))
    page.goto(url)
    drawn = "(name) => document.querySelectorAll('#live ' + name).length"
    wait(page, "scrnnLive.polls >= 3 && document.querySelectorAll('#live .loops svg').length > 0")
    points = page.evaluate("document.querySelector('#live .curve .ours').getAttribute('points').split(' ').length")
    stand = page.locator("#live .stand").inner_text()
    # The connection is lost, and comes back.
    page.context.set_offline(True)
    wait(page, "scrnnLive.failed > 0")
    lost = page.locator("#live .stand").inner_text()
    page.context.set_offline(False)
    polls = page.evaluate("scrnnLive.polls")
    wait(page, f"scrnnLive.polls > {polls}")
    return {
        "points": points, "stand": stand, "lost": lost, "back": page.locator("#live .stand").inner_text(), "loops": page.evaluate(drawn, ".loops svg"),
        "foreign": [one for one in asked if not one.startswith(url) and not one.startswith("data:")],
    }


def main():
    problems = []
    with sync_playwright() as playwright:
        browser = launch(playwright)
        if sys.argv[1] == "step":
            result = step(browser, sys.argv[2], sys.argv[3:])
        elif sys.argv[1] == "drag":
            result = drag(browser, pathlib.Path(sys.argv[2]), problems)
        elif sys.argv[1] == "live":
            result = live(browser, sys.argv[2], problems)
        else:
            result = view(browser, pathlib.Path(sys.argv[2]), sys.argv[3], sys.argv[4], problems)
        browser.close()
    print(json.dumps(result))
    for problem in problems:
        print(problem, file=sys.stderr)
    sys.exit(1 if problems else 0)


main()
