"""List of screens."""

from enum import StrEnum

from messages.i18n import N_


class Screen(StrEnum):
    """All screens, in the order of the side bar: name, title, icon.

    `WindowPresenter` has a presenter of the same name. The view is `<Name>Screen` in `app.qt.<name>.screen`,
    unless `app.qt.window` makes another one.
    """

    label: str
    icon: str  # Phosphor name

    START = "start", N_("Start"), "house"
    RECORD = "record", N_("Record"), "record"
    IDENTIFY = "identify", N_("Identify"), "chart-line"
    RUNS = "runs", N_("Runs"), "stack"
    CAMPAIGN = "campaign", N_("Campaign"), "table"
    GAUGES = "gauges", N_("Gauges"), "gauge"
    STAND = "stand", N_("Simulated"), "flask"
    SETTINGS = "settings", N_("Settings"), "gear"

    def __new__(cls, name: str, label: str, icon: str) -> "Screen":
        member = str.__new__(cls, name)
        member._value_, member.label, member.icon = name, label, icon
        return member
