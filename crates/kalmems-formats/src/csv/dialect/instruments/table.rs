//! Instruments and programs that write text: what their first lines show, and where names, units and clock stand. A new one is a row
//! here and a file under `tests/fixtures/csv`.

/// How an instrument writes.
pub(in crate::csv::dialect) struct InstrumentDialect {
    /// The instrument or program, as messages name it.
    pub(in crate::csv::dialect) name: &'static str,
    pub(super) signature: Signature,
    pub(super) layout: TextLayout,
}

/// What an instrument is known by.
pub(super) enum Signature {
    /// A comment begins with this.
    Comment(&'static str),
    /// The first line, or the one behind it, begins with this.
    Line(&'static str),
    /// Cells of the first line.
    Cells(&'static [(usize, &'static str)]),
}

/// Where the columns stand.
pub(super) enum TextLayout {
    /// Names above rows, as anywhere; the units that the text does not say, by the beginnings of names.
    Plain(&'static [(&'static str, &'static str)]),
    /// Names in the line whose first cell is one of these, with rows below.
    Titled { first_cells: &'static [&'static str], names: NamePlace, units: UnitPlace },
    /// Lines of keys with a value for each waveform, then rows of values, with times before them or not.
    Waveforms(WaveformKeys),
    /// Keys and their values in the first cells of the rows, times and values in these two behind.
    BesideRows { time: usize, value: usize },
}

/// Where the names of columns stand.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum NamePlace {
    Header,
    /// In the header, before two cells that have start and step of the clock in the line below; the first column counts the steps.
    HeaderBeforeClock(&'static str, &'static str),
    /// Behind the first of these keys that is there; the first column is the time.
    Keys(&'static [&'static str]),
}

/// Where the units of columns stand.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum UnitPlace {
    /// So many lines behind the names, where each of its cells is one or holds one in brackets.
    Line(usize),
    /// Behind keys: that of the first column, and those of the others.
    Keys(&'static str, &'static str),
    /// Nowhere: those that are known by the name of the column, and what is said of the others.
    Known(&'static [(&'static str, &'static str)], &'static str),
}

/// Keys of waveforms. A unit stands behind the first key that is there, in its first or a later line.
pub(super) struct WaveformKeys {
    /// Names; without that key they stand in the first line behind an empty cell, or are numbers.
    pub(super) names: &'static str,
    pub(super) starts: &'static str,
    pub(super) steps: &'static str,
    pub(super) time_units: &'static [(&'static str, usize)],
    pub(super) value_units: &'static [(&'static str, usize)],
}

use NamePlace::{Header, HeaderBeforeClock};
use Signature::{Cells, Comment, Line};
use UnitPlace::Known;

/// One with names in the line whose first cell is one of these.
const fn titled(
    name: &'static str,
    signature: Signature,
    first_cells: &'static [&'static str],
    names: NamePlace,
    units: UnitPlace,
) -> InstrumentDialect {
    InstrumentDialect { name, signature, layout: TextLayout::Titled { first_cells, names, units } }
}

/// One with names above rows, known by a comment, with the units of columns by the beginnings of their names.
const fn plain(
    name: &'static str,
    comment: &'static str,
    units: &'static [(&'static str, &'static str)],
) -> InstrumentDialect {
    InstrumentDialect { name, signature: Comment(comment), layout: TextLayout::Plain(units) }
}

/// One with a value for each waveform behind keys.
const fn waveforms(name: &'static str, signature: Signature, keys: WaveformKeys) -> InstrumentDialect {
    InstrumentDialect { name, signature, layout: TextLayout::Waveforms(keys) }
}

const RIGOL: &str = "a Rigol oscilloscope";
const TEKTRONIX: &str = "a Tektronix oscilloscope";
const TEKTRONIX_UNITS: UnitPlace = UnitPlace::Keys("Horizontal Units", "Vertical Units");
const LABONE: &str = "LabOne (Zurich Instruments)";
const LABONE_UNITS: UnitPlace = Known(&[("freq", "Hz")], "no units, times in ticks of the device's clock");
const LECROY_UNITS: UnitPlace = Known(&[("Time", "s")], "times in seconds, no unit of the amplitudes");
const INFINIIUM: WaveformKeys = WaveformKeys {
    names: "",
    starts: "XOrg",
    steps: "XInc",
    time_units: &[("XUnits", 0), ("Units", 0)],
    value_units: &[("YUnits", 0), ("Units", 1)],
};
const YOKOGAWA: WaveformKeys = WaveformKeys {
    names: "TraceName",
    starts: "HOffset",
    steps: "HResolution",
    time_units: &[("HUnit", 0)],
    value_units: &[("VUnit", 0)],
};
const XSENS_UNITS: &[(&str, &str)] = &[
    ("Acc_", "m_per_s2"),
    ("FreeAcc_", "m_per_s2"),
    ("Gyr_", "rad_per_s"),
    ("Roll", "deg"),
    ("Pitch", "deg"),
    ("Yaw", "deg"),
];

/// The first that fits counts.
pub(in crate::csv::dialect) const ALL: [InstrumentDialect; 17] = [
    // DS1000 and its kin: `X,CH1,Start,Increment,`, then `Sequence,Volt,-3e-04,1e-07`. What newer ones write is known as any text.
    titled(RIGOL, Cells(&[(0, "X")]), &["X"], HeaderBeforeClock("Start", "Increment"), UnitPlace::Line(1)),
    // UltraScope: `"Number of Data points =",8192,` and lines of settings, the channels behind `"Channel Data"`.
    titled(
        RIGOL,
        Cells(&[(0, "Number of Data points =")]),
        &["Time (s)"],
        NamePlace::Keys(&["Channel Data"]),
        UnitPlace::Line(0),
    ),
    // InfiniiVision: `x-axis,1,2`, then `second,Volt,Volt`.
    titled("a Keysight oscilloscope", Cells(&[(0, "x-axis")]), &["x-axis"], Header, UnitPlace::Line(1)),
    waveforms("a Keysight Infiniium oscilloscope", Line("Revision:"), INFINIIUM),
    // `LECROYWR640Zi,12345,Waveform`, lines on the segments, then `Time,Ampl`.
    titled("a LeCroy oscilloscope", Line("LECROY"), &["Time"], Header, LECROY_UNITS),
    // Lines of settings, then `Second,Volt,Volt`; the channels stand in `Source,CH1,CH2` in newer ones, in
    // `Vertical Scale,CH1: 0.05,CH2: 1.0` in older.
    titled(
        "a Siglent oscilloscope",
        Line("Record Length,Analog"),
        &["Second"],
        NamePlace::Keys(&["Source", "Vertical Scale"]),
        UnitPlace::Line(0),
    ),
    // TDS and TBS1000.
    InstrumentDialect {
        name: "a Tektronix TDS oscilloscope",
        signature: Cells(&[(0, "Record Length")]),
        layout: TextLayout::BesideRows { time: 3, value: 4 },
    },
    // Series 2 to 6 and TBS.
    titled(TEKTRONIX, Cells(&[(0, "Record Length")]), &["TIME", "Time"], Header, TEKTRONIX_UNITS),
    titled(TEKTRONIX, Cells(&[(0, "Model")]), &["TIME", "Time"], Header, TEKTRONIX_UNITS),
    // DL, DLM and ScopeCorder: `"Header Size",16`; below the keys stands an empty cell, or the time.
    waveforms("a Yokogawa oscilloscope", Cells(&[(0, "Header Size")]), YOKOGAWA),
    titled(LABONE, Cells(&[(0, "chunk"), (1, "timestamp")]), &["chunk", "timestamp"], Header, LABONE_UNITS),
    titled(LABONE, Cells(&[(0, "timestamp"), (1, "value")]), &["chunk", "timestamp"], Header, LABONE_UNITS),
    plain("a Moku", "Moku", &[]),
    plain("sigrok", "CSV generated by libsigrok", &[]),
    plain("sigrok", "CSV, generated by libsigrok", &[]),
    // X16, X2, HAM and their kin: times in seconds, counts of the sensor.
    plain("a logger of Gulf Coast Data Concepts", "Title, http://www.gcdataconcepts.com", &[("time", "s")]),
    // MT Manager.
    plain("MT Manager (Xsens)", "Start Time:", XSENS_UNITS),
];
