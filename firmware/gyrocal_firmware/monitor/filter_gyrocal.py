"""`pio device monitor` with `monitor_filters = gyrocal`: sentences of PROTOCOL.md as people read them.

Damaged sentences are shown as such; of the raw samples one in a quarter of a second is shown.
"""

import binascii

from platformio.public import DeviceMonitorFilterBase

RAW_EVERY_US = 250_000
AXES = "xyz"


class Gyrocal(DeviceMonitorFilterBase):
    """Takes the port's bytes as they come, gives whole lines."""

    NAME = "gyrocal"

    def __init__(self, *args, **kwargs):
        super().__init__(*args, **kwargs)
        self.rest = ""
        self.lsb_dps = {}
        self.shown_us = {}

    def rx(self, text: str) -> str:
        """What to show for these bytes of the device."""
        *lines, self.rest = (self.rest + text).split("\n")
        shown = (self.readable(line.rstrip("\r")) for line in lines)
        return "".join(line + "\n" for line in shown if line is not None)

    def tx(self, text: str) -> str:
        """What is typed goes to the device as it is."""
        return text

    def readable(self, line: str) -> str | None:
        """A line for people; None to show nothing."""
        noise, dollar, sentence = line.rpartition("$")
        body, _, crc = sentence.partition("*")
        if not dollar or crc != f"{binascii.crc_hqx(body.encode(), 0xFFFF):04X}":
            return f"? damaged: {line}" if line.startswith("$") else line
        told = self.readable_body(body)
        return f"? skipped: {noise}\n{told}" if noise and told is not None else told

    def readable_body(self, body: str) -> str | None:
        """What is between `$` and `*` of a sentence."""
        tag, _, t_us, imu, *fields = body.split(",")
        values = dict(field.partition("=")[::2] for field in fields)
        if tag == "HEL":
            self.lsb_dps[imu] = float(values["lsb_dps"])
        show = getattr(self, f"show_{tag.lower()}", self.show_other)
        told = show(values, fields, imu, int(t_us))
        if show == self.show_other:
            told = f"{tag} {told}"
        return None if told is None else f"{int(t_us) / 1e6:10.3f} s  sensor {imu}  {told}"

    def show_cal(self, values, _fields, _imu, _t_us):
        """Scale in percent, bias in mdps."""
        scale = self.number(values["scale"], values["scale_se"], 100.0, 4, "%")
        bias = self.number(values["bias_dps"], values["bias_se_dps"], 1000.0, 1, "mdps")
        misfit = f", misfit {float(values['misfit']):.2f}" if values["misfit"] else ""
        what = f"{values['method']}, {float(values['seconds']):g} s, axis {values['axis']}"
        against = values.get("flags", "")
        trust = f", NOT TRUSTED: {against.replace('+', ', ')}" if against else ""
        return f"RESULT {what}: scale {scale}, bias {bias}{misfit}{trust}"

    def show_raw(self, _values, fields, imu, t_us):
        """Rates, seldom enough to read."""
        if 0 <= t_us - self.shown_us.get(imu, -RAW_EVERY_US) < RAW_EVERY_US:
            return None
        self.shown_us[imu] = t_us
        lsb = self.lsb_dps.get(imu)
        if lsb is None:
            return (
                "rates "
                + " ".join(f"{a} {n}" for a, n in zip(AXES, fields[1:4], strict=True))
                + " counts (send hello for deg/s)"
            )
        return "rates " + " ".join(f"{a} {lsb * int(n):+9.3f}" for a, n in zip(AXES, fields[1:4], strict=True)) + " deg/s"

    def show_gyr(self, _values, fields, imu, t_us):
        """Corrected rates, likewise."""
        if 0 <= t_us - self.shown_us.get(imu, -RAW_EVERY_US) < RAW_EVERY_US:
            return None
        self.shown_us[imu] = t_us
        rates = (f"{a} {float(v):+9.3f}" if v else f"{a} uncalibrated" for a, v in zip(AXES, fields[1:4], strict=True))
        return "corrected " + " ".join(rates) + " deg/s"

    def show_err(self, values, _fields, _imu, _t_us):
        """What is wrong and what to do."""
        return f"ERROR {values['name']} ({values['code']}): {values['advice'].replace('_', ' ')}"

    def show_other(self, values, fields, _imu, _t_us):
        """Names and values as they are."""
        named = (f"{name} {value or '-'}" for name, value in values.items())
        return ", ".join(named) if values else " ".join(fields)

    @staticmethod
    def number(value: str, error: str, factor: float, digits: int, unit: str) -> str:
        if not value:
            return "-"
        spread = f" ± {factor * float(error):.{digits}f}" if error else ""
        return f"{factor * float(value):.{digits}f}{spread} {unit}"
