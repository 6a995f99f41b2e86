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
use TextLayout::{BesideRows, Plain, Titled, Waveforms};

/// The first that fits counts.
pub(in crate::csv::dialect) const ALL: [InstrumentDialect; 17] = [
    // DS1000 and its kin: `X,CH1,Start,Increment,`, then `Sequence,Volt,-3e-04,1e-07`. What newer ones write is known as any text.
    InstrumentDialect {
        name: "a Rigol oscilloscope",
        signature: Cells(&[(0, "X")]),
        layout: Titled {
            first_cells: &["X"],
            names: HeaderBeforeClock("Start", "Increment"),
            units: UnitPlace::Line(1),
        },
    },
    // UltraScope: `"Number of Data points =",8192,` and lines of settings, the channels behind `"Channel Data"`.
    InstrumentDialect {
        name: "a Rigol oscilloscope",
        signature: Cells(&[(0, "Number of Data points =")]),
        layout: Titled {
            first_cells: &["Time (s)"],
            names: NamePlace::Keys(&["Channel Data"]),
            units: UnitPlace::Line(0),
        },
    },
    // InfiniiVision: `x-axis,1,2`, then `second,Volt,Volt`.
    InstrumentDialect {
        name: "a Keysight oscilloscope",
        signature: Cells(&[(0, "x-axis")]),
        layout: Titled { first_cells: &["x-axis"], names: Header, units: UnitPlace::Line(1) },
    },
    InstrumentDialect {
        name: "a Keysight Infiniium oscilloscope",
        signature: Line("Revision:"),
        layout: Waveforms(WaveformKeys {
            names: "",
            starts: "XOrg",
            steps: "XInc",
            time_units: &[("XUnits", 0), ("Units", 0)],
            value_units: &[("YUnits", 0), ("Units", 1)],
        }),
    },
    // `LECROYWR640Zi,12345,Waveform`, lines on the segments, then `Time,Ampl`.
    InstrumentDialect {
        name: "a LeCroy oscilloscope",
        signature: Line("LECROY"),
        layout: Titled {
            first_cells: &["Time"],
            names: Header,
            units: UnitPlace::Known(&[("Time", "s")], "times in seconds, no unit of the amplitudes"),
        },
    },
    // Lines of settings, then `Second,Volt,Volt`; the channels stand in `Source,CH1,CH2` in newer ones, in
    // `Vertical Scale,CH1: 0.05,CH2: 1.0` in older.
    InstrumentDialect {
        name: "a Siglent oscilloscope",
        signature: Line("Record Length,Analog"),
        layout: Titled {
            first_cells: &["Second"],
            names: NamePlace::Keys(&["Source", "Vertical Scale"]),
            units: UnitPlace::Line(0),
        },
    },
    // TDS and TBS1000.
    InstrumentDialect {
        name: "a Tektronix TDS oscilloscope",
        signature: Cells(&[(0, "Record Length")]),
        layout: BesideRows { time: 3, value: 4 },
    },
    // Series 2 to 6 and TBS.
    InstrumentDialect {
        name: "a Tektronix oscilloscope",
        signature: Cells(&[(0, "Record Length")]),
        layout: TEKTRONIX,
    },
    InstrumentDialect {
        name: "a Tektronix oscilloscope",
        signature: Cells(&[(0, "Model")]),
        layout: TEKTRONIX,
    },
    // DL, DLM and ScopeCorder: `"Header Size",16`; below the keys stands an empty cell, or the time.
    InstrumentDialect {
        name: "a Yokogawa oscilloscope",
        signature: Cells(&[(0, "Header Size")]),
        layout: Waveforms(WaveformKeys {
            names: "TraceName",
            starts: "HOffset",
            steps: "HResolution",
            time_units: &[("HUnit", 0)],
            value_units: &[("VUnit", 0)],
        }),
    },
    InstrumentDialect {
        name: "LabOne (Zurich Instruments)",
        signature: Cells(&[(0, "chunk"), (1, "timestamp")]),
        layout: LABONE,
    },
    InstrumentDialect {
        name: "LabOne (Zurich Instruments)",
        signature: Cells(&[(0, "timestamp"), (1, "value")]),
        layout: LABONE,
    },
    InstrumentDialect { name: "a Moku", signature: Comment("Moku"), layout: Plain(&[]) },
    InstrumentDialect {
        name: "sigrok",
        signature: Comment("CSV generated by libsigrok"),
        layout: Plain(&[]),
    },
    InstrumentDialect {
        name: "sigrok",
        signature: Comment("CSV, generated by libsigrok"),
        layout: Plain(&[]),
    },
    // X16, X2, HAM and their kin: times in seconds, counts of the sensor.
    InstrumentDialect {
        name: "a logger of Gulf Coast Data Concepts",
        signature: Comment("Title, http://www.gcdataconcepts.com"),
        layout: Plain(&[("time", "s")]),
    },
    // MT Manager.
    InstrumentDialect {
        name: "MT Manager (Xsens)",
        signature: Comment("Start Time:"),
        layout: Plain(&[
            ("Acc_", "m_per_s2"),
            ("FreeAcc_", "m_per_s2"),
            ("Gyr_", "rad_per_s"),
            ("Roll", "deg"),
            ("Pitch", "deg"),
            ("Yaw", "deg"),
        ]),
    },
];

const TEKTRONIX: TextLayout = Titled {
    first_cells: &["TIME", "Time"],
    names: Header,
    units: UnitPlace::Keys("Horizontal Units", "Vertical Units"),
};

const LABONE: TextLayout = Titled {
    first_cells: &["chunk", "timestamp"],
    names: Header,
    units: UnitPlace::Known(&[("freq", "Hz")], "no units, times in ticks of the device's clock"),
};
