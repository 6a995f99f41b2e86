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
    /// The first cells of the first line.
    Cells(&'static [&'static str]),
    /// Cells of the first line, wherever in it.
    Holds(&'static [&'static str]),
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
    /// In the header, before two cells that have start and step of the clock in the line below; a first column `X` counts the steps.
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

use NamePlace::{Header, HeaderBeforeClock, Keys};
use Signature::{Cells, Comment, Holds, Line};
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
const RIGOL_NAMES: [&str; 5] = ["X", "CH1", "CH2", "CH3", "CH4"];
const RIGOL_CLOCK: NamePlace = HeaderBeforeClock("Start", "Increment");
const SIGLENT: &str = "a Siglent oscilloscope";
const TEKTRONIX: &str = "a Tektronix oscilloscope";
/// In the line of the first column's name.
const OWN_LINE: UnitPlace = UnitPlace::Line(0);
const TEKTRONIX_UNITS: UnitPlace = UnitPlace::Keys("Horizontal Units", "Vertical Units");
const LABONE: &str = "LabOne (Zurich Instruments)";
const LABONE_UNITS: UnitPlace = Known(&[("freq", "Hz")], "no units, times in ticks of the device's clock");
const LABCHART: &str = "LabChart (ADInstruments)";
/// The last of its lines of settings, of files with units of the channels and without.
const LABCHART_LAST: [&str; 2] = ["BottomValue=", "Range="];
const LABCHART_UNITS: UnitPlace = Known(&[("time", "s")], "times in seconds, no units of the channels");
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
const GW_INSTEK: WaveformKeys = WaveformKeys {
    names: "Source",
    starts: "",
    steps: "Sampling Period",
    time_units: &[("Horizontal Units", 0)],
    value_units: &[("Vertical Units", 0)],
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
pub(in crate::csv::dialect) const ALL: [InstrumentDialect; 20] = [
    // DS1000 and its kin: `X,CH1,Start,Increment,`, then `Sequence,Volt,-3e-04,1e-07`, or channels alone. What newer ones write is
    // known as any text.
    titled(RIGOL, Holds(&["Start", "Increment"]), &RIGOL_NAMES, RIGOL_CLOCK, UnitPlace::Line(1)),
    // UltraScope: `"Number of Data points =",8192,` and lines of settings, the channels behind `"Channel Data"`.
    titled(RIGOL, Cells(&["Number of Data points ="]), &["Time (s)"], Keys(&["Channel Data"]), OWN_LINE),
    // InfiniiVision: `x-axis,1,2`, then `second,Volt,Volt`.
    titled("a Keysight oscilloscope", Cells(&["x-axis"]), &["x-axis"], Header, UnitPlace::Line(1)),
    waveforms("a Keysight Infiniium oscilloscope", Line("Revision:"), INFINIIUM),
    // `LECROYWR640Zi,12345,Waveform`, lines on the segments, then `Time,Ampl`.
    titled("a LeCroy oscilloscope", Line("LECROY"), &["Time"], Header, LECROY_UNITS),
    // Lines of settings, then `Second,Volt,Volt`; the channels stand in `Source,CH1,CH2` in newer ones, in
    // `Vertical Scale,CH1: 0.05,CH2: 1.0` in older.
    titled(SIGLENT, Line("Record Length,Analog"), &["Second"], Keys(&["Source", "Vertical Scale"]), OWN_LINE),
    // TDS and TBS1000.
    InstrumentDialect {
        name: "a Tektronix TDS oscilloscope",
        signature: Cells(&["Record Length"]),
        layout: TextLayout::BesideRows { time: 3, value: 4 },
    },
    // Series 2 to 6 and TBS.
    titled(TEKTRONIX, Cells(&["Record Length"]), &["TIME", "Time"], Header, TEKTRONIX_UNITS),
    titled(TEKTRONIX, Cells(&["Model"]), &["TIME", "Time"], Header, TEKTRONIX_UNITS),
    // GDS-1000 and MDO-2000 with times: lines of settings, `Waveform Data,`, then times and values.
    waveforms("a GW Instek oscilloscope", Cells(&["Memory Length"]), GW_INSTEK),
    // DL, DLM and ScopeCorder: `"Header Size",16`; below the keys stands an empty cell, or the time.
    waveforms("a Yokogawa oscilloscope", Cells(&["Header Size"]), YOKOGAWA),
    titled(LABONE, Cells(&["chunk", "timestamp"]), &["chunk", "timestamp"], Header, LABONE_UNITS),
    titled(LABONE, Cells(&["timestamp", "value"]), &["chunk", "timestamp"], Header, LABONE_UNITS),
    // `.atf`: `ATF 1.0`, how many lines of settings and columns follow, then the names.
    titled("pCLAMP (Axon)", Line("ATF"), &["Time (s)"], Header, Known(&[], "units in the names")),
    // Text of LabChart: lines such as `Interval=`, the channels behind `ChannelTitle=`, and rows behind the last of them.
    titled(LABCHART, Line("Interval="), &LABCHART_LAST, Keys(&["ChannelTitle="]), LABCHART_UNITS),
    plain("a Moku", "Moku", &[]),
    plain("sigrok", "CSV generated by libsigrok", &[]),
    plain("sigrok", "CSV, generated by libsigrok", &[]),
    // X16, X2, HAM and their kin: times in seconds, counts of the sensor.
    plain("a logger of Gulf Coast Data Concepts", "Title, http://www.gcdataconcepts.com", &[("time", "s")]),
    // MT Manager.
    plain("MT Manager (Xsens)", "Start Time:", XSENS_UNITS),
];
