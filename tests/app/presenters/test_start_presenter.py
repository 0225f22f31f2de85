"""The start page checks what was filled in and leads on."""

import pytest

from app.acquisition.messages import PortSettings
from app.presenters.navigator import ConnectForm
from app.presenters.recent import RecentItems
from app.presenters.start_screen import PortChoice, StartPresenter, StartState, connect_form, port_settings
from config.schema import RecentDevice, RecentUse
from drivers.driver import DeviceDriver


class FakeDoors:
    def __init__(self) -> None:
        self.opened: list[object] = []

    def open_simulated(self, series: str) -> None:
        self.opened.append(series)

    def open_port(self, port: PortSettings) -> None:
        self.opened.append(port)

    def close_connection(self) -> None:
        self.opened.append("closed")

    def open_run(self, path: str) -> None:
        self.opened.append(path)


@pytest.fixture
def doors() -> FakeDoors:
    return FakeDoors()


@pytest.fixture
def presenter(doors: FakeDoors) -> StartPresenter:
    state = StartState(all_series=("1FFM0", "3SSLM2"), series="1FFM0")
    return StartPresenter(state, doors, lambda: (PortChoice("COM7", "FT232R"),))


def test_a_form_becomes_settings_with_blanks_left_to_the_device() -> None:
    form = ConnectForm(" /dev/ttyUSB0 ", "csv", "", "")
    assert port_settings(form) == PortSettings("/dev/ttyUSB0", "csv", parity="N", stop_bits=1)
    form = ConnectForm("COM7", "csv", " 115200", "1000,5")
    assert port_settings(form) == PortSettings(
        "COM7", "csv", baud=115200, parity="N", stop_bits=1, rate_hz=1000.5
    )


@pytest.mark.parametrize(
    ("form", "words"),
    [
        (ConnectForm("  ", "csv"), "Choose a port"),
        (ConnectForm("COM7", "csv", "fast"), "Baud 'fast' is not a number above 0"),
        (ConnectForm("COM7", "csv", "9600.5"), "Baud '9600.5' is not a whole number"),
        (ConnectForm("COM7", "csv", "", "-1"), "Rate '-1' is not a number above 0"),
        (ConnectForm("COM7", "csv", "", "inf"), "Rate 'inf' is not a number above 0"),
        (ConnectForm("COM7", "csv", "", "nan"), "Rate 'nan' is not a number above 0"),
    ],
)
def test_what_cannot_be_is_said_with_its_remedy(
    presenter: StartPresenter, doors: FakeDoors, form: ConnectForm, words: str
) -> None:
    presenter.set_form(form)
    presenter.connect()
    assert presenter.state.form_error.startswith(words)
    assert doors.opened == []
    presenter.set_form(ConnectForm("COM7", "csv"))
    assert presenter.state.form_error == ""


def test_each_way_leads_on(presenter: StartPresenter, doors: FakeDoors) -> None:
    presenter.set_series("3SSLM2")
    presenter.start_simulation()
    presenter.set_form(ConnectForm("COM7", "csv"))
    presenter.connect()
    presenter.navigator.close_connection()
    assert doors.opened == ["3SSLM2", PortSettings("COM7", "csv", parity="N", stop_bits=1), "closed"]


def test_nothing_is_opened_twice_while_something_is_awaited(
    presenter: StartPresenter, doors: FakeDoors
) -> None:
    presenter.set_busy("Starting the simulated stand")
    presenter.set_form(ConnectForm("COM7", "csv"))
    presenter.start_simulation()
    presenter.connect()
    assert doors.opened == []
    presenter.set_connected("Slipstand simulator")
    assert (presenter.state.busy, presenter.state.connected) == ("", "Slipstand simulator")
    presenter.start_simulation()
    assert doors.opened == ["1FFM0"]


def test_a_series_that_does_not_exist_is_not_chosen(presenter: StartPresenter) -> None:
    presenter.set_series("9XXM9")
    assert presenter.state.series == "1FFM0"


def test_ports_are_looked_for_when_asked(presenter: StartPresenter) -> None:
    assert presenter.state.ports == ()
    presenter.refresh()
    assert presenter.state.ports == (PortChoice("COM7", "FT232R"),)


def test_what_is_known_of_the_chosen_protocol(doors: FakeDoors) -> None:
    csv = DeviceDriver("csv", "Lines", 1, 115200)
    state = StartState(all_series=(), series="", protocols=(csv,))
    presenter = StartPresenter(state, doors, tuple)
    assert presenter.state.selected_protocol is None
    presenter.set_form(ConnectForm(protocol="csv"))
    assert presenter.state.selected_protocol is csv


def test_parity_own_settings_and_a_second_port_reach_the_device() -> None:
    form = ConnectForm(
        "COM7", "modbus", parity="E", stop_bits="2", settings=" map=dat1400  unit=2 ", relative_port=" COM8 "
    )
    assert port_settings(form) == PortSettings(
        "COM7", "modbus", parity="E", stop_bits=2, device={"map": "dat1400", "unit": "2"}, relative_url="COM8"
    )
    with pytest.raises(ValueError, match="Device setting 'unit' is no KEY=VALUE"):
        port_settings(ConnectForm("COM7", "modbus", settings="map=dat1400 unit"))


LAST = RecentDevice("GSV-8", "COM7", "gsv", "57600", rate_hz="1000.5", usb="USB 0403:6001 A9")


def start_again(doors: FakeDoors, ports: tuple[PortChoice, ...]) -> StartPresenter:
    """Start of a window after one in which `LAST` was connected."""
    state = StartState(all_series=(), series="", form=ConnectForm(protocol="csv"))
    return StartPresenter(state, doors, lambda: ports, RecentItems(RecentUse(LAST, ("/runs/a.h5",))))


def test_the_last_amplifier_is_one_click_away_and_fills_the_form(doors: FakeDoors) -> None:
    presenter = start_again(doors, (PortChoice("COM7", usb=LAST.usb),))
    assert presenter.state.last_device == "GSV-8 on COM7"
    assert presenter.state.form == ConnectForm("COM7", "gsv", "57600", "1000.5")
    assert presenter.state.runs == ("/runs/a.h5",)
    presenter.connect_last()
    presenter.open_run("/runs/a.h5")
    assert doors.opened == [PortSettings("COM7", "gsv", 57600, "N", 1, 1000.5), "/runs/a.h5"]


@pytest.mark.parametrize(
    ("ports", "url"),
    [
        ((PortChoice("COM7", usb="USB 2341:0043"), PortChoice("COM9", usb=LAST.usb)), "COM9"),
        ((PortChoice("COM8", usb=LAST.usb), PortChoice("COM9", usb=LAST.usb)), "COM7"),
        ((PortChoice("COM9"),), "COM7"),
    ],
)
def test_its_adapter_is_found_under_another_name_where_there_is_only_one(
    doors: FakeDoors, ports: tuple[PortChoice, ...], url: str
) -> None:
    start_again(doors, ports).connect_last()
    (opened,) = doors.opened
    assert isinstance(opened, PortSettings)
    assert opened.url == url


def test_without_a_last_amplifier_nothing_is_connected(presenter: StartPresenter, doors: FakeDoors) -> None:
    presenter.connect_last()
    assert (presenter.state.last_device, doors.opened) == ("", [])


def test_a_connected_amplifier_becomes_the_last_one(doors: FakeDoors) -> None:
    saved: list[RecentUse] = []
    state = StartState(all_series=(), series="")
    ports = (PortChoice("COM7", usb=LAST.usb),)
    presenter = StartPresenter(state, doors, lambda: ports, RecentItems(save=saved.append))
    presenter.refresh()
    presenter.remember_device("GSV-8", PortSettings("COM7", "gsv", 57600, rate_hz=1000.5))
    assert saved == [RecentUse(LAST)]
    assert presenter.state.last_device == "GSV-8 on COM7"


def test_settings_of_a_port_and_its_form_say_the_same() -> None:
    port = PortSettings("COM7", "modbus", 9600, "E", 2, 0.1, {"map": "dat1400", "unit": "2"}, "COM8")
    assert port_settings(connect_form(port)) == port
