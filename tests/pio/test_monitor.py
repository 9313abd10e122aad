"""The serial monitor's filter: every sentence readable, damaged ones told apart, nothing lost between chunks."""

import binascii
import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gyrocal_firmware import ROOT


def sentence(body: str) -> str:
    return f"${body}*{binascii.crc_hqx(body.encode(), 0xFFFF):04X}\n"


@pytest.fixture
def monitor(require_module: Callable[[str], None], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Any:
    require_module("platformio")
    monkeypatch.chdir(tmp_path)
    spec = importlib.util.spec_from_file_location("filter_gyrocal", ROOT / "monitor" / "filter_gyrocal.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    spec.loader.exec_module(module)
    return module.Gyrocal()


def test_a_result_in_percent_and_mdps(monitor: Any) -> None:
    text = sentence(
        "CAL,7,25000488,0,method=model,seconds=6,axis=z,scale=0.00364156817,scale_se=7.59701858e-05,"
        "bias_dps=-0.111887253,bias_se_dps=0.0059044384,temp_c=28.2,misfit=1.01,first=1160,last=1449"
    )
    shown = monitor.rx(text)
    assert shown == (
        "    25.000 s  sensor 0  RESULT model, 6 s, axis z: scale 0.3642 ± 0.0076 %, bias -111.9 ± 5.9 mdps, misfit 1.01\n"
    )
    assert monitor.rx(text.replace("scale=0.0036", "scale=0.0037")).startswith("? damaged: $CAL,7")
    rest = sentence("CAL,8,1,0,method=rest,seconds=20,axis=z,scale=,scale_se=,bias_dps=0.1,bias_se_dps=,temp_c=,misfit=")
    assert "scale -, bias 100.0 mdps\n" in monitor.rx(rest)


def test_an_error_says_what_to_do(monitor: Any) -> None:
    shown = monitor.rx(sentence("ERR,3,1500000,1,code=-1,name=bus_nack,advice=check_wiring_and_power"))
    assert shown == "     1.500 s  sensor 1  ERROR bus_nack (-1): check wiring and power\n"


def test_a_sentence_is_read_behind_the_noise_of_a_boot(monitor: Any) -> None:
    shown = monitor.rx("\ufffd\x00\ufffd" + sentence("ACK,2,2000000,0,cmd=stop"))
    assert shown == "? skipped: \ufffd\x00\ufffd\n     2.000 s  sensor 0  ACK cmd stop\n"
    assert monitor.rx("noise$ACK,2,2,0,cmd=stop*0000\n") == "noise$ACK,2,2,0,cmd=stop*0000\n"


def test_chunks_of_any_size_give_the_same_lines(monitor: Any) -> None:
    text = "# boot\r\n" + sentence("STA,1,1,0,state=idle,face=,n=0") + ">gx:1.5\n" + sentence("ACK,2,2,0,cmd=stop")
    whole = "# boot\n     0.000 s  sensor 0  STA state idle, face -, n 0\n>gx:1.5\n     0.000 s  sensor 0  ACK cmd stop\n"
    assert monitor.rx(text) == whole
    assert "".join(monitor.rx(c) for c in text) == whole


def test_raw_samples_in_deg_per_s_four_times_a_second(monitor: Any) -> None:
    assert "-8970 counts" in monitor.rx(sentence("RAW,0,10,0,0,-13,-12,-8970,15,3,-16398,888"))
    monitor.rx(sentence("HEL,1,20,0,proto=1,lsb_dps=0.00875"))
    lines = [monitor.rx(sentence(f"RAW,{k},{k * 6897},0,{k},-13,-12,-8970,15,3,-16398,888")) for k in range(1000)]
    shown = [line for line in lines if line]
    assert len(shown) == pytest.approx(6.897 * 4, abs=2)
    assert "z   -78.488 deg/s" in shown[-1]
    assert "x    +1.250 y uncalibrated z    -2.500 deg/s" in monitor.rx(sentence("GYR,9,9000000,0,1,1.25,,-2.5"))
