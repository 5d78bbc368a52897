"""Uses pages in a headless browser as a person would, and writes what they did as JSON on stdout.

    use_page.py step STEP.js FOLDER...      runs network.json of each folder along its samples.json, into browser.json
    use_page.py drag PAGE [NETWORK]         chooses the network, drags its initial state, runs every learned state without noise
    use_page.py live URL                    watches a training: what is drawn, and who is answered
    use_page.py view PAGE RECORDING BODY    plays the page to its end; where the body is drawn, and where the recording has it
    use_page.py marks PAGE RECORDING        what the page marks under its time bar, and what the recording has at which times
    use_page.py poses PAGE BODY TIME...     where a body is at these times, in the world and on the canvas
    use_page.py motion URL                  watches a robot or a stream: what is drawn, and whether a lost connection comes back
    use_page.py many URL                    watches many trainings until all are over
    use_page.py read PAGE                   the page at 390 pixels, light, dark and printed: what is too wide, hidden or hard to read

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


def drag(browser, file, network, problems):
    page = opened(browser, file, problems)
    choice = page.locator("#playground .network")
    networks = choice.locator("option").all_inner_texts()
    if network is not None:
        choice.select_option(label=network)
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
    if page.locator("#playground .noise").is_visible():
        page.locator("#playground .noise").check()
    noisy = orbit()
    page.locator("#playground .push").evaluate("node => { node.value = 80; node.dispatchEvent(new Event('input')); }")
    return {
        "networks": networks, "can_choose": choice.is_visible(),
        "shown": {part: page.locator(f"#playground {part}").first.is_visible() for part in (".orbit", ".noise")},
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
        "curves": page.locator("#view .signals svg").count(), "marks": page.locator("#view .marks line:not(.hand)").count(),
        "canvas": [box["width"], box["height"]],
    }


def happened(recording):
    """Kind, time and words of all contacts, events and sequences, in the order of time; what touches all the time is no contact."""
    from mcap.reader import make_reader

    found, first, messages, touched = [], None, 0, {}
    with open(recording, "rb") as file:
        for _, channel, message in make_reader(file).iter_messages():
            time = message.log_time
            first = time if first is None else first
            if channel.topic == "/contacts":
                messages += 1
                for contact in json.loads(message.data)["contacts"]:
                    touched.setdefault(f"{contact['a']} and {contact['b']}", []).append(time)
            elif channel.topic in ("/events", "/sequence"):
                kind = "event" if channel.topic == "/events" else "sequence"
                found.append([kind, time, json.loads(message.data)["name"]])
    for pair, times in touched.items():
        if len(times) <= 0.9 * messages:
            found += [["contact", time, pair] for time in times]
    return sorted([kind, (time - first) / 1e9, words] for kind, time, words in found)


def marks(browser, file, recording, problems):
    page = opened(browser, file, problems)
    drawn = page.evaluate("""() => [...document.querySelectorAll("#view .marks line:not(.hand)")].map((line) => {
        const [x1, x2] = ["x1", "x2"].map((name) => Number(line.getAttribute(name))), box = line.getBoundingClientRect();
        return { kind: line.getAttribute("class"), time: (x1 / 1000) * scrnnView.data.length, words: line.textContent, upright: x1 === x2,
                 seen: getComputedStyle(line).stroke !== "none" && box.height > 1 };
    })""")
    told = []
    for _, time, _ in [one for one in happened(recording) if one[0] == "event"][:3]:
        page.evaluate("time => scrnnView.go(time)", time)
        told.append(page.locator("#view .now").inner_text())
    return {"drawn": drawn, "recorded": happened(recording), "told": told, "text": page.locator("main").inner_text()}


def poses(browser, file, body, times, problems):
    page = opened(browser, file, problems)
    one = """([body, time]) => {
        const found = scrnnView.bodies.find((one) => one.name === body);
        scrnnView.go(time);
        const place = scrnnView.placeOf(found, time);
        return { place, form: found.form, size: found.size, drawn: scrnnView.measure(body), projected: scrnnView.project(place.slice(0, 3)) };
    }"""
    found = [page.evaluate(one, [body, float(time)]) for time in times]
    return {"poses": found, "curves": page.locator("#view .signals svg").count(), "text": page.locator("main").inner_text()}


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


def watched(browser, url, problems):
    """A page from a server, with all that it asks for."""
    page = browser.new_page(viewport={"width": 1000, "height": 900})
    asked = []
    page.on("request", lambda request: asked.append(request.url))
    page.on("pageerror", lambda error: problems.append(f"error: {error}"))
    page.goto(url)
    return page, lambda: [one for one in asked if not one.startswith(url) and not one.startswith("data:")]


def motion(browser, url, problems):
    page, foreign = watched(browser, url, problems)
    stand = lambda: page.locator("#motion .stand").inner_text()
    # Two samples with what was expected of them.
    wait(page, "scrnnMotion.state.frames.filter(one => one.s && one.m).length >= 3 && document.querySelectorAll('#motion .error .off').length > 0")
    robot = page.evaluate("scrnnMotion.state.bodies.length")
    found = {"bodies": robot, "first": stand(), "channels": page.locator("#motion .signals svg").count()}
    found["curves"] = page.evaluate("[...document.querySelectorAll('#motion .signals svg')].map(one => one.querySelectorAll('polyline').length)")
    found["look"] = page.evaluate("(scrnnMotion.state.look || {forecast: []}).forecast.length")
    found["bands"] = page.locator("#motion .signals .band").count()
    found["errors"] = page.evaluate("scrnnMotion.state.frames.filter(one => one.e !== undefined).map(one => one.e)")
    if robot:
        place = """() => {
            const state = scrnnMotion.state, k = state.bodies.findIndex((one) => one.name === "self/r_hand" && one.form === "sphere");
            return scrnnMotion.placed(k, state.frames.findLast((one) => one.places).t);
        }"""
        found["hand"] = page.evaluate(place)
        found["drawn"] = page.evaluate("""() => { const state = scrnnMotion.state; state.held = true;
            const k = state.bodies.findIndex((one) => one.name === "self/r_hand" && one.form === "sphere"), body = state.bodies[k], name = body.name;
            body.name = "measured";
            const drawn = scrnnMotion.measure("measured"), place = scrnnMotion.placed(k, state.shown);
            body.name = name;
            state.held = false;
            return { drawn, projected: scrnnMotion.project(place.slice(0, 3)) }; }""")
        newest = "scrnnMotion.state.frames[scrnnMotion.state.frames.length - 1].t"
        wait(page, f"{newest} > {page.evaluate(newest) + 1.5}")
        found["later"] = page.evaluate(place)
    # The connection is lost, and comes back.
    page.context.set_offline(True)
    wait(page, "scrnnMotion.state.failed > 0 && document.querySelector('#motion .stand').textContent.includes('no answer') || scrnnMotion.state.finished")
    found["lost"] = page.evaluate("scrnnMotion.state.failed")
    page.context.set_offline(False)
    polls = page.evaluate("scrnnMotion.state.polls")
    wait(page, f"scrnnMotion.state.polls > {polls}")
    wait(page, "!document.querySelector('#motion .stand').textContent.includes('no answer')")
    times = page.evaluate("scrnnMotion.state.frames.map(one => one.t)")
    found.update({"back": stand(), "in_order": times == sorted(times), "frames": len(times), "foreign": foreign()})
    return found


def many(browser, url, problems):
    page, foreign = watched(browser, url, problems)
    wait(page, "scrnnMany.runs.length > 0 && document.querySelectorAll('#many .runs tr').length === scrnnMany.runs.length")
    first = page.locator("#many .stand").inner_text()
    wait(page, "scrnnMany.runs.filter(one => one.curve.length > 1).length > 0")
    wait(page, "scrnnMany.over")
    page.locator("#many .runs tr").first.hover()
    return {
        "first": first, "last": page.locator("#many .stand").inner_text(), "rows": page.locator("#many .runs tr").count(),
        "curves": page.locator("#many polyline.curve:not(.held)").count(), "marked": page.locator("#many .marked").count(),
        "key": page.locator("#many .key").inner_text(), "foreign": foreign(),
    }


# Texts that can be seen, each with its contrast against what lies behind it (WCAG 2).
READ = """() => {
    const numbers = (colour) => (colour.match(/[\\d.]+/g) || []).map(Number);
    const light = ([r, g, b]) => [r, g, b].map((c) => (c /= 255) <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4).reduce((sum, c, k) => sum + c * [0.2126, 0.7152, 0.0722][k], 0);
    const behind = (node) => {
        for (; node; node = node.parentElement) {
            const colour = numbers(getComputedStyle(node).backgroundColor);
            if (colour.length === 3 || colour[3] > 0.99) return colour;
        }
        return [255, 255, 255];
    };
    const contrast = (a, b) => { const [low, high] = [light(a), light(b)].sort((x, y) => x - y); return (high + 0.05) / (low + 0.05); };
    const texts = [];
    for (const node of document.querySelectorAll("h1, h2, p, a, td, th, caption, figcaption, figcaption b, .thesis, .files, pre, svg text")) {
        if (!node.textContent.trim() || !node.getClientRects().length) continue;
        const style = getComputedStyle(node), svg = node.namespaceURI.endsWith("svg");
        texts.push({ tag: node.tagName.toLowerCase(), text: node.textContent.trim().slice(0, 40), contrast: contrast(numbers(svg ? style.fill : style.color), behind(node)) });
    }
    texts.sort((a, b) => a.contrast - b.contrast);
    const verdict = document.querySelector(".verdict"), box = verdict && verdict.getBoundingClientRect();
    return {
        wide: document.documentElement.scrollWidth - window.innerWidth,
        texts: texts.length, faintest: texts[0],
        verdict: verdict && { text: verdict.textContent, left: box.left, right: box.right, top: box.top + scrollY, height: box.height, seen: verdict.checkVisibility() },
    };
}"""


def read(browser, file, problems):
    found = {}
    for name, scheme, media in [("light", "light", "screen"), ("dark", "dark", "screen"), ("print", "light", "print")]:
        context = browser.new_context(viewport={"width": 390, "height": 800}, color_scheme=scheme)
        page = context.new_page()
        url = file.resolve().as_uri()
        page.on("request", lambda request: None if request.url == url or request.url.startswith("data:") else problems.append(request.url))
        page.on("console", lambda message: problems.append(f"console: {message.text}"))
        page.on("pageerror", lambda error: problems.append(f"error: {error}"))
        page.emulate_media(media=media, color_scheme=scheme)
        page.goto(url)
        found[name] = page.evaluate(READ)
        # Until all is laid out and drawn, by the browser's own clock.
        timing = "() => { const [one] = performance.getEntriesByType('navigation'), paint = performance.getEntriesByName('first-contentful-paint')[0]; return [one.loadEventEnd, paint ? paint.startTime : one.loadEventEnd]; }"
        wait(page, "performance.getEntriesByType('navigation')[0].loadEventEnd > 0")
        found[name]["milliseconds"] = max(page.evaluate(timing))
        context.close()
    return found


def main():
    problems = []
    with sync_playwright() as playwright:
        browser = launch(playwright)
        if sys.argv[1] == "step":
            result = step(browser, sys.argv[2], sys.argv[3:])
        elif sys.argv[1] == "drag":
            result = drag(browser, pathlib.Path(sys.argv[2]), sys.argv[3] if len(sys.argv) > 3 else None, problems)
        elif sys.argv[1] == "live":
            result = live(browser, sys.argv[2], problems)
        elif sys.argv[1] == "marks":
            result = marks(browser, pathlib.Path(sys.argv[2]), sys.argv[3], problems)
        elif sys.argv[1] == "poses":
            result = poses(browser, pathlib.Path(sys.argv[2]), sys.argv[3], sys.argv[4:], problems)
        elif sys.argv[1] == "motion":
            result = motion(browser, sys.argv[2], problems)
        elif sys.argv[1] == "many":
            result = many(browser, sys.argv[2], problems)
        elif sys.argv[1] == "read":
            result = read(browser, pathlib.Path(sys.argv[2]), problems)
        else:
            result = view(browser, pathlib.Path(sys.argv[2]), sys.argv[3], sys.argv[4], problems)
        browser.close()
    print(json.dumps(result))
    for problem in problems:
        print(problem, file=sys.stderr)
    sys.exit(1 if problems else 0)


main()
