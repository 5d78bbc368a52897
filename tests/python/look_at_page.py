"""Opens a page in a headless browser: it must show all figures, ask for nothing, and say nothing on the console.

    look_at_page.py PAGE [SHOTS]

The browser is SCRNN_BROWSER, else chromium or chrome on the path, else the one that `playwright install chromium` got.
With SHOTS, a folder, pictures of the page on a phone, on a desk in light and dark, and as printed are left there. Ends with code 3
if there is no browser.
"""

import os
import pathlib
import shutil
import sys

from playwright.sync_api import Error, sync_playwright

NAMES = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"]

# Each figure: its box, how much is drawn, and the colours of text and background.
LOOK = """() => [...document.querySelectorAll('figure')].map(figure => {
    const svg = figure.querySelector('svg');
    const box = svg.getBoundingClientRect();
    const text = svg.querySelector('text');
    return {
        id: figure.id, width: box.width, height: box.height,
        drawn: svg.querySelectorAll('polyline, circle, text').length,
        ink: text ? getComputedStyle(text).fill : '',
        paper: getComputedStyle(document.body).backgroundColor,
    };
})"""


def launch(playwright):
    """A browser, or none."""
    found = [os.environ.get("SCRNN_BROWSER")] + [shutil.which(name) for name in NAMES]
    for path in [path for path in found if path] + [None]:
        try:
            return playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        except Error as error:
            why = str(error).splitlines()[0]
    print(f"no browser: {why}", file=sys.stderr)
    sys.exit(3)


def brightness(colour):
    """From 0 to 1, of rgb(r, g, b)."""
    red, green, blue = (float(part) for part in colour[colour.index("(") + 1 : colour.index(")")].split(",")[:3])
    return (0.299 * red + 0.587 * green + 0.114 * blue) / 255


def main():
    page_file = pathlib.Path(sys.argv[1]).resolve()
    shots = pathlib.Path(sys.argv[2]) if len(sys.argv) > 2 else None
    problems, count = [], 0
    with sync_playwright() as playwright:
        browser = launch(playwright)
        for name, width, scheme in [("light", 1200, "light"), ("dark", 1200, "dark"), ("phone", 375, "dark")]:
            context = browser.new_context(viewport={"width": width, "height": 800}, color_scheme=scheme)
            page = context.new_page()
            asked = []
            page.on("request", lambda request, asked=asked: asked.append(request.url))
            page.on("console", lambda message, name=name: problems.append(f"{name}: console: {message.text}"))
            page.on("pageerror", lambda error, name=name: problems.append(f"{name}: error: {error}"))
            page.goto(page_file.as_uri())
            page.wait_for_load_state("networkidle")
            others = [url for url in asked if url != page_file.as_uri() and not url.startswith("data:")]
            problems += [f"{name}: asks for {url}" for url in others]
            figures = page.evaluate(LOOK)
            count = len(figures)
            for figure in figures:
                if figure["width"] < 200 or figure["height"] < 80 or figure["drawn"] < 2:
                    problems.append(f"{name}: {figure['id']} is not visible: {figure}")
                if figure["ink"] and abs(brightness(figure["ink"]) - brightness(figure["paper"])) < 0.5:
                    problems.append(f"{name}: the text of {figure['id']} cannot be read: {figure}")
            wide = page.evaluate("document.documentElement.scrollWidth - window.innerWidth")
            if wide > 0:
                problems.append(f"{name}: the page is {wide} pixels wider than the window")
            if shots:
                shots.mkdir(parents=True, exist_ok=True)
                page.screenshot(path=shots / f"{name}.png", full_page=True)
                if name == "light":
                    page.pdf(path=shots / "print.pdf", format="A4")
            context.close()
        browser.close()
    if count == 0:
        problems.append("the page has no figure")
    for problem in problems:
        print(problem, file=sys.stderr)
    if problems:
        sys.exit(1)
    print(f"{count} figures, nothing asked for, nothing on the console")


if __name__ == "__main__":
    main()
