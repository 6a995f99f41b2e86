//! What can be asked for.

use crate::{CommandEnding, target};
use clap::{Args, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;
use kalmems::recording::{CsvHints, Format, Hints};
use kalmems::results::{Output, Work};
use kalmems::study::Shard;
use std::num::NonZero;
use std::path::PathBuf;

/// What stands below the help.
const BELOW: &str = "To begin: `kalmems new --list`, then `kalmems help start`. Topics such as `verdict` or `recordings`: \
    `kalmems help topics`.\n\n\
    Exit codes: 0 success; 1 the data or the configuration is wrong, or no filter gave an estimate; 2 usage; 3 under \
    --strict, a filter's answer is doubtful or worse; 4 the connection that samples came over broke; 5 some recordings of a batch could \
    not be estimated, and the results have all others; 6 no filter had an estimate when a stream ended; 130 interrupted; 141 nobody reads \
    a stream's output any more.";

/// Motion estimation for MEMS devices with capacitive sensors.
#[derive(Parser)]
#[command(name = "kalmems", version, about, after_help = BELOW, max_term_width = 100, disable_help_subcommand = true)]
pub struct CommandLine {
    /// Print the result and errors only: no progress, no notes, no hint at the next command.
    #[arg(long, short, global = true)]
    pub quiet: bool,
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Subcommand)]
pub enum Command {
    /// Estimate many recordings by one experiment, with the trajectories of each in a Parquet file and one table of all.
    #[cfg(feature = "parquet-results")]
    Batch(BatchArguments),
    /// Calibrate an instrument by a known motion.
    Calibrate(CalibrateArguments),
    /// Lay results of `kalmems estimate` over one another in one page.
    Compare(CompareArguments),
    /// Print a script that completes the command's words in a shell.
    Completions(CompletionsArguments),
    /// Find the cause of a bad verdict by the innovations of a filter, with the lines to write instead.
    Diagnose(DiagnoseArguments),
    /// Estimate a device's motion from its recordings, and compare it with the reference.
    Estimate(EstimateArguments),
    /// Write an experiment with its device as differential equations, which can then be changed.
    Expand(ExpandArguments),
    /// Write a filter of an experiment as source code for a microcontroller.
    Export(ExportArguments),
    /// Explain a command, a topic such as `verdict`, or the names that an experiment with a device may use.
    Help(HelpArguments),
    /// Identify a device's parameters from its recordings, with standard errors, and list those that they do not determine.
    Identify(IdentifyArguments),
    /// Reconstruct an image from intensities and the trajectories along which they were recorded.
    Image(ImageArguments),
    /// Describe a recording, or predict what the device of an experiment file will do under its drive.
    Inspect(InspectArguments),
    /// Print the manual page of the command, or of one of its commands.
    Man(ManArguments),
    /// Write an experiment file to begin with, from a recording or for a device.
    New(NewArguments),
    /// Compute the tables and figures of a published device and compare them with those of its papers.
    #[cfg(feature = "papers")]
    Reproduce(ReproduceArguments),
    /// Compute a recording from the `[simulate]` table of an experiment file.
    Simulate(SimulateArguments),
    /// Join the journals of a study that was run in shards, and write its results.
    Merge(MergeArguments),
    /// Print the JSON schema of experiment, study, image, spectrum or calibration files, for editors.
    Schema(SchemaArguments),
    /// Compute a spectrum from interferograms and the positions along which they were taken.
    Spectrum(SpectrumArguments),
    /// Estimate samples while they arrive, as the table `[stream]` of an experiment file says.
    Stream(StreamArguments),
    /// Simulate and estimate an experiment many times, over a grid or with random parameters, and compare the filters or test their claims.
    Study(StudyArguments),
    /// Serve the results of a folder to the browsers of this machine: their verdicts, and their reports down to single samples.
    #[cfg(not(target_family = "wasm"))]
    View(ViewArguments),
}

// Where the results of a command are put; each command says in its help which folder that is where none is named. A doc comment here would
// take the place of the help of the command.
#[derive(Args)]
pub struct ResultFolder {
    /// The folder for the results.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Put aside, as DIR.previous, the result of another experiment, or one with files that were changed since.
    #[arg(long)]
    force: bool,
}

impl ResultFolder {
    /// Prepares the folder for what a work gives: that which was asked for, or else the one with these steps below `out`.
    /// What may not be replaced is refused here, before any time is spent.
    pub fn begin(&self, usual: &[&str], work: Work) -> Result<Output, CommandEnding> {
        target::begin(self.out.as_ref(), usual, &work.forced(self.force))
    }
}

/// What stands below the help of `batch`.
#[cfg(feature = "parquet-results")]
const BELOW_BATCH: &str = "Results: `trajectories/NAME.parquet` of each recording, with the columns `segment`, `stretch` and `filter` in front; \
    `summary.csv` with a row for each recording; `results.csv` with all figures of all filters; `report.html`. Both tables are there as Parquet \
    as well.\n\n\
    What is finished is kept in a journal beside the folder: after an interruption, or with further recordings, the same command computes \
    only what is missing. Recordings with the same content are estimated once.\n\n\
    Exit codes: 0 all recordings were estimated; 5 some could not be estimated, and the table says why of each; 1 none could, or the \
    experiment is wrong; 3 under --strict, an answer is doubtful or worse; 130 interrupted.";

#[cfg(feature = "parquet-results")]
#[derive(Args)]
#[command(after_help = BELOW_BATCH)]
pub struct BatchArguments {
    /// The recordings: files, or patterns such as \"recordings/*.csv\" in quotes.
    #[arg(value_name = "RECORDING", required = true)]
    pub recordings: Vec<String>,
    /// The experiment file, in which each recording stands in the place of the one that it names.
    #[arg(long, value_name = "FILE")]
    pub experiment: PathBuf,
    /// Which recording of the experiment they stand for, by its name or role [default: the only one, or the only one with the role `test`].
    #[arg(long = "as", value_name = "NAME")]
    pub of: Option<String>,
    /// The file of each recording's reference, with `{name}` in the place of the recording's name, such as `truth/{name}.csv`; without it, a
    /// reference in a file of its own is left out.
    #[arg(long, value_name = "FILE")]
    pub reference: Option<String>,
    /// The folder for the results; the journal of what is finished stands beside it [default: out/batches/<name of the experiment>].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Put aside the results, and the journal, of another batch.
    #[arg(long)]
    pub force: bool,
    /// How many recordings at once; the results do not depend on it [default: as many as the machine can]. Each takes the memory of its samples
    /// and trajectories.
    #[arg(long, value_name = "N")]
    pub threads: Option<NonZero<usize>>,
    /// End with exit code 3 if the answer of the filter to trust is doubtful or worse in a recording.
    #[arg(long)]
    pub strict: bool,
    /// Print the summary as JSON instead of a table.
    #[arg(long)]
    pub json: bool,
}

#[derive(Args)]
pub struct SchemaArguments {
    /// What the files describe.
    #[arg(value_enum, default_value_t = SchemaSubject::Experiment)]
    pub of: SchemaSubject,
    /// Write the schema to this file and not to the console.
    #[arg(long, value_name = "FILE")]
    pub write: Option<PathBuf>,
    /// Put a file aside, as FILE.previous, that stands where the schema is to be written.
    #[arg(long, requires = "write")]
    pub force: bool,
}

#[derive(Args)]
pub struct CompletionsArguments {
    /// The shell.
    #[arg(value_enum)]
    pub shell: Shell,
}

#[derive(Args)]
pub struct ManArguments {
    /// The command, such as `estimate` or `calibrate gyro`; `kalmems` itself if left out.
    pub command: Vec<String>,
}

#[derive(Args)]
pub struct HelpArguments {
    /// A command, such as `estimate`; a topic, such as `verdict`; `topics` for a list of them; `device NAME` for the channels, states,
    /// parameters and methods of a device.
    #[arg(value_name = "TOPIC")]
    pub topic: Vec<String>,
    /// Print the names of a device as JSON instead of text.
    #[arg(long)]
    pub json: bool,
}

/// What a file can describe.
#[derive(Clone, Copy, ValueEnum)]
pub enum SchemaSubject {
    /// A device, its recordings and filters.
    Experiment,
    /// The calibration of a gyroscope.
    Gyro,
    /// An image.
    Image,
    /// A spectrum.
    Spectrum,
    /// A study.
    Study,
}

#[derive(Args)]
pub struct CalibrateArguments {
    #[command(subcommand)]
    pub what: CalibrationSubject,
}

/// What can be calibrated.
#[derive(Subcommand)]
pub enum CalibrationSubject {
    /// Gyroscopes and accelerometers by vibration, positions, a rate table, over the temperature and at rest, with uncertainty budgets.
    Gyro(GyroArguments),
}

#[derive(Args)]
#[command(mut_arg("out", |out| out.help("The folder for the results [default: out/calibrated/<name of the calibration>]")))]
pub struct GyroArguments {
    /// The calibration file, such as `examples/gyroscope/calibration.toml`.
    pub file: PathBuf,
    #[command(flatten)]
    pub folder: ResultFolder,
    /// Print the figures as JSON instead of tables.
    #[arg(long)]
    pub json: bool,
}

#[derive(Args)]
#[allow(clippy::struct_excessive_bools)] // each is a flag of its own
#[command(mut_arg("out", |out| out.help("The folder for the results [default: out/<name of the experiment>]")))]
pub struct EstimateArguments {
    /// The experiment file, such as `examples/shared_scanner/experiment.toml`.
    pub experiment: PathBuf,
    #[command(flatten)]
    pub folder: ResultFolder,
    /// Print the figures as JSON instead of a table.
    #[arg(long)]
    pub json: bool,
    /// End with exit code 3 if the answer of a filter is doubtful or worse.
    #[arg(long)]
    pub strict: bool,
    /// Do not write the trajectories and the single samples of a long recording's report, which are several times as large as the recording.
    #[arg(long)]
    pub no_trajectories: bool,
}

/// What stands below the help of `new`.
const BELOW_NEW: &str = "Without `--device` the recordings are described: what each column seems to be, what its values show, and which of the \
    known devices have such channels. On a terminal the command then asks for the device and for whatever else it cannot know.\n\n\
    Examples:\n  \
    kalmems new examples/shared_scanner/recording.csv\n  \
    kalmems new examples/shared_scanner/recording.csv --device shared_scanner --write my_scanner.toml\n  \
    kalmems new --device threshold_scanner --write planned.toml";

#[derive(Args)]
#[command(after_help = BELOW_NEW)]
pub struct NewArguments {
    /// The recordings; the motion of the first is to be estimated. Further ones get the role of what they show: a free decay, a device at rest,
    /// a sweep, a steady motion. Without a recording the experiment simulates one.
    #[arg(value_name = "RECORDING")]
    pub recordings: Vec<PathBuf>,
    /// List the devices, with what the signal of each looks like.
    #[arg(long, conflicts_with_all = ["recordings", "device", "write"])]
    pub list: bool,
    /// The device, by its name in the list.
    #[arg(long, value_name = "NAME")]
    pub device: Option<String>,
    /// Which column of the recordings a channel of the device is, such as `signal=ch2_V`; more than once for several channels, or for a channel
    /// whose column has another name in another recording.
    #[arg(long = "channel", value_name = "CHANNEL=COLUMN", value_parser = pair, requires = "recordings")]
    pub channels: Vec<(String, String)>,
    /// A further recording with the role that it is to have, such as `ring_down=decay.csv`; more than once for several.
    #[arg(long = "further", value_name = "ROLE=FILE", value_parser = pair, requires = "recordings")]
    pub further: Vec<(String, String)>,
    #[command(flatten)]
    pub file: FileArguments,
    /// The rate of the samples, such as `1 MHz`, of recordings without a column of times, or instead of it where its times cannot be used.
    #[arg(long, value_name = "RATE", requires = "recordings")]
    pub rate: Option<String>,
    /// Which column is the time, and its unit, such as `t=ms`, where the name of the column does not say it; it counts in each recording that has
    /// such a column.
    #[arg(long, value_name = "COLUMN=UNIT", value_parser = pair, requires = "recordings")]
    pub time: Option<(String, String)>,
    /// A number of your device in the place of the published one, such as `comb.angular_width=0.21 rad`; more than once for several.
    #[arg(long = "value", value_name = "KEY=VALUE", value_parser = pair, requires = "device")]
    pub values: Vec<(String, String)>,
    /// Write it to this file and not to the console.
    #[arg(long, value_name = "FILE")]
    pub write: Option<PathBuf>,
    /// Put a file aside, as FILE.previous, that stands where the experiment is to be written.
    #[arg(long, requires = "write")]
    pub force: bool,
    /// Print the experiment, or the list, as JSON with what was found in the recordings; where something is not known, the questions.
    #[arg(long)]
    pub json: bool,
}

/// Two texts about the first `=`.
fn pair(text: &str) -> Result<(String, String), String> {
    let (first, second) = text.split_once('=').ok_or("expected two names with `=` between them")?;
    Ok((first.trim().to_owned(), second.trim().to_owned()))
}

#[derive(Args)]
pub struct ExpandArguments {
    /// The experiment file, such as `examples/shared_scanner/experiment.toml`.
    pub experiment: PathBuf,
    /// Write it to this file, in the same folder, and not to the console.
    #[arg(long, value_name = "FILE")]
    pub write: Option<PathBuf>,
    /// Put a file aside, as FILE.previous, that stands where the experiment is to be written.
    #[arg(long)]
    pub force: bool,
    /// Print the experiment and the notes on it as JSON.
    #[arg(long)]
    pub json: bool,
}

#[derive(Args)]
pub struct CompareArguments {
    /// The folders of the results, such as `out/shared_scanner`.
    #[arg(value_name = "RUN", required = true, num_args = 2..)]
    pub runs: Vec<PathBuf>,
    /// The page to write.
    #[arg(long, value_name = "FILE", default_value = "out/compare.html")]
    pub report: PathBuf,
    /// Put a file aside, as FILE.previous, that stands where the page is to be written.
    #[arg(long)]
    pub force: bool,
    /// Print the names of the page and of the runs as JSON.
    #[arg(long)]
    pub json: bool,
}

#[derive(Args)]
pub struct DiagnoseArguments {
    /// The experiment file, such as `examples/shared_scanner/experiment.toml`.
    pub experiment: PathBuf,
    /// The filter whose innovations are looked at, by its name [default: the first that is a Kalman filter].
    #[arg(long, value_name = "NAME")]
    pub filter: Option<String>,
    /// Try all causes, however long it takes: without it a diagnosis ends after the work of about twenty estimates, and says what it leaves out.
    #[arg(long)]
    pub thorough: bool,
    /// Write a copy of the experiment file with the cause corrected to this file, in the same folder. Of several with different answers, which
    /// the recording does not tell apart, none is written unless `--cause` names it.
    #[arg(long, value_name = "FILE")]
    pub write: Option<PathBuf>,
    /// The cause to write, by its name or its place in the list: 1 for the first.
    #[arg(long, value_name = "NAME", requires = "write")]
    pub cause: Option<String>,
    /// Write the report, a page to look into, to this HTML file as well.
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// Put a file aside, as FILE.previous, that stands where the experiment or the report is to be written.
    #[arg(long)]
    pub force: bool,
    /// Print the result as JSON instead of text.
    #[arg(long)]
    pub json: bool,
}

#[derive(Args)]
pub struct StreamArguments {
    /// The experiment file, such as `examples/shared_scanner/stream.toml`.
    pub experiment: PathBuf,
    /// Where samples come from: `-` for standard input, `tcp://HOST:PORT` to connect to, `listen://HOST:PORT` to wait for a
    /// connection at, or a file, a named pipe or a serial device. A connection or a serial device that breaks, or is closed without the
    /// line `# end`, ends the command with 4, unless `reconnect` in `[stream]` lets it go on.
    #[arg(long, value_name = "SOURCE", default_value = "-")]
    pub from: String,
    /// The rate of a serial device in bits per second; the device is then opened as one.
    #[arg(long, value_name = "BITS_PER_S")]
    pub baud: Option<u32>,
    /// Write the report, a page to look into, to this HTML file at the end.
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// Write estimates and events as lines to this file; `-` for standard output. Without this and `--frames` they go to standard
    /// output, or, where that is a terminal, to the file `out/streams/<name of the experiment>.txt`.
    #[arg(long, value_name = "FILE")]
    pub lines: Option<PathBuf>,
    /// Write estimates as frames in binary to this file; `-` for standard output.
    #[arg(long, value_name = "FILE")]
    pub frames: Option<PathBuf>,
    /// Send estimates and events as JSON to a program that draws them, such as PlotJuggler: `udp-json://HOST:PORT`, a datagram for each
    /// line; `udp-json://` alone is port 9870 of this machine. Or write them to an MCAP file, for Foxglove and others: `mcap://FILE`. Lines
    /// are then written only where `--lines` is given as well. It may be given several times.
    #[arg(long, value_name = "ADDRESS")]
    pub to: Vec<String>,
    /// Complete the files of `--lines`, `--frames` and `--to mcap://` at this size, such as `100 MB`, and begin the next: FILE is the
    /// present one, and one that is completed has the time of its beginning in its name. A signal SIGHUP does the same at once.
    #[arg(long, value_name = "SIZE")]
    pub rotate_size: Option<String>,
    /// Complete these files after this time, such as `1 h`.
    #[arg(long, value_name = "TIME")]
    pub rotate_every: Option<String>,
    /// Write how the stream fares to this file every second, in the text format of Prometheus; for the textfile collector of its
    /// node exporter the name ends with `.prom`.
    #[arg(long, value_name = "FILE")]
    pub metrics: Option<PathBuf>,
    /// Put aside, as FILE.previous, also files that no stream wrote; what one wrote is always kept so.
    #[arg(long)]
    pub force: bool,
    /// Keep in this file what is needed to go on, and go on from it where it is there: samples up to the time of the last line
    /// `acknowledged` need not be sent again.
    #[arg(long, value_name = "FILE")]
    pub state: Option<PathBuf>,
    /// Print the summary at the end as JSON instead of text.
    #[arg(long)]
    pub json: bool,
}

#[cfg(not(target_family = "wasm"))]
#[derive(Args)]
pub struct ViewArguments {
    /// The folder with the results; what is below it is found, and what links lead to is not served.
    #[arg(default_value = "out")]
    pub folder: PathBuf,
    /// The port on 127.0.0.1 [default: one that is free].
    #[arg(long, value_name = "PORT", default_value_t = 0, hide_default_value = true)]
    pub port: u16,
}

#[derive(Args)]
#[command(mut_arg("out", |out| out.help("The folder for the source [default: out/exported/<name of the experiment>]")))]
pub struct ExportArguments {
    /// The experiment file, such as `examples/shared_scanner/microcontroller.toml`.
    pub experiment: PathBuf,
    /// The language.
    #[arg(long, value_enum)]
    pub target: Language,
    /// The filter, by its name, such as `Euler EKF` [default: the first of the file that does not use Euler's method, which is the least
    /// accurate].
    #[arg(long, value_name = "NAME")]
    pub filter: Option<String>,
    /// The sampling rate, such as `500 kHz` [default: that of the first recording].
    #[arg(long, value_name = "RATE")]
    pub rate: Option<String>,
    /// Correct the filter by every N-th sample only, and predict between them.
    #[arg(long, value_name = "N", default_value = "1")]
    pub update_every: NonZero<u32>,
    /// Also write N samples of the first recording as tables, for a test of the filter.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub samples: usize,
    /// A parameter that the program may change while it runs, of a device that is described by equations; may be given several times.
    #[arg(long, value_name = "NAME")]
    pub adjustable: Vec<String>,
    /// How many digits the source computes with, of a device that is described by equations; as needed to come within 1e-5 of the filter
    /// of `estimate` over the recording if left out.
    #[arg(long, value_enum)]
    pub digits: Option<ExportDigits>,
    /// Compile the source here (by `cc` or `rustc`), run it over the whole first stretch of the recording, and compare it with the estimate.
    #[arg(long)]
    pub verify: bool,
    /// Also write the files with which tools build the source: of C for CMake, Meson, PlatformIO, Arduino and Zephyr, a
    /// program that takes samples from an interrupt, and a unit of FMI 3.0; of Rust a crate. For a device that is described by equations.
    #[arg(long)]
    pub project: bool,
    /// Estimate the instructions of a step on this processor, of a device that is described by equations.
    #[arg(long, value_enum)]
    pub cpu: Option<Processor>,
    /// The clock of that processor, such as `168 MHz`.
    #[arg(long, value_name = "FREQUENCY", requires = "cpu")]
    pub clock: Option<String>,
    /// Write nothing if a step takes longer than this, such as `10 us`, at two cycles for each instruction.
    #[arg(long, value_name = "TIME", requires = "clock")]
    pub budget: Option<String>,
    #[command(flatten)]
    pub folder: ResultFolder,
    /// Print the names of the files as JSON instead of a list.
    #[arg(long)]
    pub json: bool,
}

/// How many digits exported source computes with.
#[derive(Clone, Copy, ValueEnum)]
pub enum ExportDigits {
    /// Numbers of 32 bits.
    Single,
    /// Means and covariance in numbers of 64 bits.
    Double,
}

/// Processors whose instructions are estimated.
#[derive(Clone, Copy, ValueEnum)]
pub enum Processor {
    /// Floating point of 32 bits.
    #[value(name = "cortex-m4f")]
    CortexM4f,
    /// Floating point of 32 and 64 bits.
    #[value(name = "cortex-m7")]
    CortexM7,
    /// No floating point.
    #[value(name = "cortex-m0plus")]
    CortexM0plus,
    /// RISC-V with floating point of 32 bits.
    #[value(name = "rv32imfc")]
    Rv32imfc,
}

/// The languages of an export.
#[derive(Clone, Copy, ValueEnum)]
pub enum Language {
    /// C99 without any library.
    C,
    /// Rust with `kalmems-core` and `kalmems-models`, without `std`.
    Rust,
}

#[derive(Args)]
#[command(mut_arg("out", |out| out.help("The folder for the results [default: out/identified/<name of the experiment>]")))]
pub struct IdentifyArguments {
    /// The experiment file, such as `examples/shared_scanner/ring_down.toml`.
    pub experiment: PathBuf,
    #[command(flatten)]
    pub folder: ResultFolder,
    /// Print the figures as JSON instead of a table.
    #[arg(long)]
    pub json: bool,
}

#[derive(Args)]
#[command(mut_arg("out", |out| out.help("The folder for the results [default: out/image/<name of the image>]")))]
pub struct ImageArguments {
    /// The image file, such as `examples/shared_scanner/image.toml`.
    pub image: PathBuf,
    #[command(flatten)]
    pub folder: ResultFolder,
    /// The phase by which x is ahead of its trajectory, such as `0.7deg`, instead of the value in the file.
    #[arg(long, value_name = "ANGLE", allow_hyphen_values = true)]
    pub phase_x: Option<String>,
    /// The phase by which y is ahead of its trajectory.
    #[arg(long, value_name = "ANGLE", allow_hyphen_values = true)]
    pub phase_y: Option<String>,
    /// A grey PNG with which the image is compared.
    #[arg(long, value_name = "FILE")]
    pub reference: Option<PathBuf>,
    /// Print the figures as JSON instead of text.
    #[arg(long)]
    pub json: bool,
}

/// How a recording is written, where that cannot be told from it.
#[derive(Args)]
pub struct FileArguments {
    /// The format of the recording, whatever its name says: csv, npy, npz, parquet, hdf5, mat, tdms or wav.
    #[arg(long, value_name = "FORMAT", value_parser = format)]
    pub format: Option<Format>,
    /// Where the samples are in a file of several tables: a group of HDF5 or TDMS, a matrix of MAT, an array of NPZ.
    #[arg(long, value_name = "NAME")]
    pub group: Option<String>,
    /// The names of all columns with their units, in their order, where the file has none: `time_s,cap_V`.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub columns: Option<Vec<String>>,
    /// Of a text: the line of the names, counted from 1.
    #[arg(long, value_name = "LINE")]
    pub header_line: Option<NonZero<u64>>,
    /// Of a text: what stands between the cells, `,`, `;`, `|`, `tab` or `blank`.
    #[arg(long, value_name = "MARK", value_parser = separator)]
    pub separator: Option<char>,
    /// Of a text: the decimal mark, `.` or `,`.
    #[arg(long, value_name = "MARK")]
    pub decimal: Option<char>,
}

impl FileArguments {
    /// As readers of files take them.
    pub fn hints(&self) -> Hints {
        Hints {
            format: self.format,
            group: self.group.clone(),
            columns: self.columns.clone(),
            csv: CsvHints {
                separator: self.separator,
                decimal: self.decimal,
                header_line: self.header_line.map(NonZero::get),
                ..CsvHints::default()
            },
            arrays: None,
        }
    }
}

fn format(text: &str) -> Result<Format, String> {
    Format::named(text).ok_or_else(|| {
        let known: Vec<&str> = Format::ALL.iter().map(|(name, _)| *name).collect();
        format!("expected one of {}", known.join(", "))
    })
}

fn separator(text: &str) -> Result<char, String> {
    match text {
        "tab" | "\\t" | "\t" => Ok('\t'),
        "blank" | " " => Ok(' '),
        "," | ";" | "|" => Ok(text.chars().next().unwrap_or(',')),
        _ => Err("expected `,`, `;`, `|`, `tab` or `blank`".to_owned()),
    }
}

#[derive(Args)]
pub struct InspectArguments {
    /// The recording; or an experiment file, `*.toml`, whose device is described.
    #[arg(value_name = "FILE")]
    pub input: PathBuf,
    #[command(flatten)]
    pub file: FileArguments,
    /// The rate of the samples, such as `1 MHz`, of a recording without a column of times, or instead of it.
    #[arg(long, value_name = "RATE")]
    pub rate: Option<String>,
    /// Which column is the time, and its unit, such as `t=ms`, where the name of the column does not say it.
    #[arg(long, value_name = "COLUMN=UNIT", value_parser = pair)]
    pub time: Option<(String, String)>,
    /// Draw it to this SVG file as well.
    #[arg(long, value_name = "FILE")]
    pub svg: Option<PathBuf>,
    /// Of a recording: write the report, a page to look into, to this HTML file as well.
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// Of an experiment file: write report, text, data and all pictures to this folder as well.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Put aside what the results would replace: the result of another experiment, files that were changed since, a
    /// file where the picture is to be.
    #[arg(long)]
    pub force: bool,
    /// Print JSON instead of text.
    #[arg(long)]
    pub json: bool,
}

#[cfg(feature = "papers")]
#[derive(Args)]
#[command(mut_arg("out", |out| out.help("The folder for the results [default: out/reproduce/<rig>]")))]
pub struct ReproduceArguments {
    /// The rig, such as `shared_scanner`.
    pub rig: String,
    /// One table or figure, such as `Table III` or `D Figure 5.9`, instead of all.
    #[arg(long, value_name = "LABEL")]
    pub only: Option<String>,
    /// Compute more seeds and longer records: minutes instead of seconds.
    #[arg(long)]
    pub full: bool,
    #[command(flatten)]
    pub folder: ResultFolder,
    /// The first seed of the noise.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u32,
    /// How many threads compute [default: as many as the machine has]; the results do not depend on it.
    #[arg(long, value_name = "N")]
    pub threads: Option<usize>,
    /// Print the figures as JSON instead of tables.
    #[arg(long)]
    pub json: bool,
}

#[derive(Args)]
#[command(mut_arg("out", |out| out.help("The folder for the recording [default: out/simulated/<name of the experiment>]")))]
pub struct SimulateArguments {
    /// The experiment file, such as `examples/shared_scanner/simulation.toml`.
    pub experiment: PathBuf,
    #[command(flatten)]
    pub folder: ResultFolder,
    /// The seed of the noise, instead of the one in the file.
    #[arg(long, value_name = "N")]
    pub seed: Option<u32>,
    /// Print the figures as JSON instead of text.
    #[arg(long)]
    pub json: bool,
}

#[derive(Args)]
#[command(mut_arg("out", |out| out.help("The folder for the results [default: out/spectrum/<name of the spectrum>]")))]
pub struct SpectrumArguments {
    /// The spectrum file, such as `examples/piston_mirror/two_lines_spectrum.toml`. That one needs the results of two commands
    /// before it: `kalmems simulate examples/piston_mirror/two_lines.toml` and
    /// `kalmems estimate out/simulated/two-lines/experiment.toml`.
    pub spectrum: PathBuf,
    #[command(flatten)]
    pub folder: ResultFolder,
    /// Print the figures as JSON instead of text.
    #[arg(long)]
    pub json: bool,
}

#[derive(Args)]
pub struct StudyArguments {
    /// The study file, such as `examples/shared_scanner/study.toml`.
    pub study: PathBuf,
    /// The folder for the results; the journal of finished runs stands beside it
    /// [default: out/studies/<name of the study>, or out/calibrations/<name>].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Replace the results, and the finished runs, of another study.
    #[arg(long)]
    pub force: bool,
    /// How many runs at once; the results do not depend on it [default: as many as the machine can].
    #[arg(long, value_name = "N")]
    pub threads: Option<NonZero<usize>>,
    /// Run one part of several, such as `2/3`, for `kalmems merge` to join.
    #[arg(long, value_name = "I/N", default_value = "1/1")]
    pub shard: Shard,
    /// Test verdicts and claimed uncertainties: each run draws the true value of every parameter that a filter has as a state from its
    /// `start_sd`, beside what the study draws, and the results are false alarms, coverage and ranks.
    /// STUDY may then be an experiment file with a table `[simulate]` as well.
    #[arg(long)]
    pub calibration: bool,
    /// Runs of a calibration at each point [default: the study's `repeats`, or 200 of an experiment file].
    #[arg(long, value_name = "N", requires = "calibration")]
    pub runs: Option<NonZero<u64>>,
    /// Print the summary as JSON instead of text.
    #[arg(long)]
    pub json: bool,
}

#[derive(Args)]
pub struct MergeArguments {
    /// The journals of all shards, such as `stiffness.1-of-2.journal stiffness.2-of-2.journal`.
    #[arg(required = true)]
    pub journals: Vec<PathBuf>,
    /// The folder for the results [default: out/studies/<name of the study>].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Replace the results of another study.
    #[arg(long)]
    pub force: bool,
    /// Print the summary as JSON instead of text.
    #[arg(long)]
    pub json: bool,
}
