"""A device made of Python that knows the command `wifi`, as a board does (PROTOCOL.md)."""

from __future__ import annotations

from .fake import FakeDevice

FIELDS = ("name", "password", "token")


class WifiBoard(FakeDevice):
    """Joins a network after being asked `asks` times, if its name and password are those of `network`."""

    def __init__(self, network: tuple[str, str] = ("lab", ""), asks: int = 0) -> None:
        super().__init__()
        self.told = dict.fromkeys(FIELDS, "")
        self.on = False
        self._network, self._asks = network, asks

    def _obey(self, text: str) -> None:
        word, _, value = text.removeprefix("wifi ").partition(" ")
        if text.split()[0] != "wifi":
            super()._obey(text)
            return
        self.commands.append(text)
        if word == "on" and not (self.told["name"] and self.told["token"]):
            self.say("ERR", {"code": -29, "name": "no_network", "advice": "send_wifi_name_and_wifi_token_first"})
            return
        if word in FIELDS:
            self.told[word] = value
        elif word == "forget":
            self.told = dict.fromkeys(FIELDS, "")
        self.on = word == "on" or (self.on and word not in ("off", "forget"))
        self.say("ACK", {"cmd": "wifi"})
        if text == "wifi":
            self._tell()

    def _tell(self) -> None:
        self._asks -= self.on
        joined = self.on and self._asks < 0 and (self.told["name"], self.told["password"]) == self._network
        self.say("NET", {
            "state": "joined" if joined else "joining" if self.on else "off", "host": "gyrocal-1a2b3c" if joined else "",
            "address": "192.168.1.7" if joined else "", "port": 4242, "reader": 0, "refused": 2,
        })  # fmt: skip
