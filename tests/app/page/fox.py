"""A headless Firefox driven over its Marionette port: standard library only, one tab."""

import json
import shutil
import socket
import subprocess
import tempfile
import time
from contextlib import suppress
from pathlib import Path

SET = """
user_pref("marionette.port", 0);
user_pref("network.dns.disabled", true);
user_pref("browser.shell.checkDefaultBrowser", false);
user_pref("intl.accept_languages", "en");
user_pref("ui.useOverlayScrollbars", 1);
user_pref("ui.prefersReducedMotion", 1);
"""


def found():
    """Return the browser's path, or None."""
    return shutil.which("firefox") or shutil.which("firefox-esr")


class Fox:
    """One tab, in which films are their last pictures, so that what is read does not hang on when."""

    def __init__(self, width=1280, height=900):
        self.profile, self.number = Path(tempfile.mkdtemp(prefix="granular-firefox-")), 0
        (self.profile / "user.js").write_text(SET)
        command = [found(), "--headless", "--marionette", "--no-remote", "--profile", str(self.profile)]
        self.process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                                        stderr=subprocess.DEVNULL)
        self.socket = socket.create_connection(("127.0.0.1", self.port()))
        self.answers = self.socket.makefile("rb")
        self.receive()
        self.call("WebDriver:NewSession")
        self.call("WebDriver:SetTimeouts", script=60_000)
        self.call("WebDriver:SetWindowRect", width=width, height=height)

    def port(self):
        """Wait until Firefox has written which port it listens at."""
        while self.process.poll() is None:
            with suppress(OSError, ValueError):
                return int((self.profile / "MarionetteActivePort").read_text())
            time.sleep(0.05)
        raise OSError("the browser has gone")

    def __enter__(self):
        return self

    def __exit__(self, *error):
        with suppress(OSError, ValueError, RuntimeError):
            self.call("Marionette:Quit", flags=["eForceQuit"])
        self.answers.close()
        self.socket.close()
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        shutil.rmtree(self.profile, ignore_errors=True)

    def receive(self):
        """Return the next message: its length, a colon, and JSON."""
        length = b""
        while (sign := self.answers.read(1)) != b":":
            if not sign:
                raise OSError("the browser has gone")
            length += sign
        return json.loads(self.answers.read(int(length)))

    def call(self, command, **params):
        """Send a command and return its result."""
        self.number += 1
        message = json.dumps([0, self.number, command, params]).encode()
        self.socket.sendall(b"%d:%s" % (len(message), message))
        _, _, error, result = self.receive()
        if error:
            raise RuntimeError(f"{command}: {error}")
        return result

    def open(self, url):
        """Go to `url` and wait until it is loaded."""
        self.call("WebDriver:Navigate", url=url)

    def run(self, expression):
        """Evaluate JavaScript (promises are awaited) and return its value."""
        script = f"const [done] = arguments; Promise.resolve({expression}).then(done);"
        return self.call("WebDriver:ExecuteAsyncScript", script=script, args=[])["value"]
