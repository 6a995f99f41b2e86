//! A source as a project: the files around it with which tools build it.

mod fmu;

use super::{ExportError, Exported, SourceLanguage};

/// A file of a project: its place, and its text with names in `@`.
type ProjectFile = (&'static str, &'static str);

const OF_C: [ProjectFile; 8] = [
    ("README.md", include_str!("README_C.md")),
    ("CMakeLists.txt", include_str!("CMakeLists.txt")),
    ("meson.build", include_str!("meson.build")),
    ("library.json", include_str!("library.json")),
    ("library.properties", include_str!("library.properties")),
    ("zephyr/module.yml", include_str!("module.yml")),
    ("zephyr/CMakeLists.txt", include_str!("zephyr.cmake")),
    ("zephyr/Kconfig", include_str!("Kconfig")),
];
const OF_RUST: [ProjectFile; 3] = [
    ("README.md", include_str!("README_RUST.md")),
    ("Cargo.toml", include_str!("Cargo.toml.txt")),
    ("src/lib.rs", include_str!("lib.txt")),
];

impl Exported {
    /// The source with the files with which tools build it: of C for CMake, Meson, PlatformIO, Arduino and Zephyr, and a unit of FMI 3.0; of Rust a crate.
    ///
    /// # Errors
    ///
    /// A source that is not made from equations.
    pub fn into_project(mut self, target: SourceLanguage) -> Result<Self, ExportError> {
        let Some(texts) = ProjectTexts::of(&self) else {
            let why =
                "its source is not one of equations, and has no project around it; leave `--project` out";
            return Err(ExportError::Filter { filter: self.filter, why: why.to_owned() });
        };
        let files = std::mem::take(&mut self.files);
        self.files = match target {
            SourceLanguage::C => texts.of_c(files),
            SourceLanguage::Rust => texts.of_rust(files),
        };
        self.input_id += ", as a project";
        Ok(self)
    }
}

/// What the names in the texts stand for.
struct ProjectTexts {
    name: String,
    about: String,
    /// The names of the numbers of a sample.
    columns: Vec<String>,
    /// The names of the states with their units.
    states: Vec<String>,
    interval_s: f64,
    /// What tells this source from another.
    token: String,
    has_self_test: bool,
}

impl ProjectTexts {
    fn of(exported: &Exported) -> Option<Self> {
        let name = exported
            .files
            .iter()
            .find_map(|(name, _)| name.strip_suffix(".c").or(name.strip_suffix(".rs")))?;
        (!exported.columns.is_empty()).then(|| Self {
            name: name.to_owned(),
            about: format!(
                "The filter {} at intervals of {:e} s, exported by kalmems",
                plain(&exported.filter),
                exported.interval_s
            ),
            columns: exported.columns.clone(),
            states: exported.states.clone(),
            interval_s: exported.interval_s,
            token: plain(&exported.input_id),
            has_self_test: exported.files.iter().any(|(name, _)| name.contains("_self_test.")),
        })
    }

    fn filled(&self, text: &str) -> String {
        let each = |of: &dyn Fn(usize) -> String| (0..self.columns.len()).map(of).collect::<String>();
        text.replace("@name@", &self.name)
            .replace("@NAME@", &self.name.to_uppercase())
            .replace("@about@", &self.about)
            .replace("@version@", env!("CARGO_PKG_VERSION"))
            .replace("@interval@", &format!("{:e}", self.interval_s))
            .replace("@token@", &self.token)
            .replace("@columns@", &self.columns.join(", "))
            .replace("@count@", &self.columns.len().to_string())
            .replace("@numbers@", &each(&|k| format!(", numbers[{k}]")))
            .replace("@gaps@", &each(&|_| ", gap".to_owned()))
    }

    /// The examples of a build file, with the self-test if the source has one.
    fn examples(&self, [examples, test, source]: [&str; 3]) -> String {
        let (test, source) = if self.has_self_test { (test.trim_end(), source) } else { ("", "") };
        examples.trim_end().replace("@self_test@", test).replace("@self_test_source@", source)
    }

    fn of_c(&self, files: Vec<(String, String)>) -> Vec<(String, String)> {
        let is_filter = |name: &str| name.strip_suffix(['c', 'h']) == Some(&format!("{}.", self.name));
        let placed = |(name, text): (String, String)| {
            (format!("{}/{name}", if is_filter(&name) { "src" } else { "example" }), text)
        };
        let mut placed: Vec<(String, String)> = files.into_iter().map(placed).collect();
        let cmake = self.examples([
            include_str!("examples.cmake"),
            include_str!("self_test.cmake"),
            " example/@name@_self_test.c",
        ]);
        let meson = self.examples([
            include_str!("examples.meson"),
            include_str!("self_test.meson"),
            ", 'example/@name@_self_test.c'",
        ]);
        for (name, text) in OF_C {
            let examples = if name == "meson.build" { &meson } else { &cmake };
            placed.push((name.to_owned(), self.filled(&text.replace("@examples@", examples))));
        }
        fmu::add(&mut placed, self);
        placed.push(("example/interrupt.c".to_owned(), self.filled(include_str!("interrupt.c"))));
        if self.has_self_test {
            placed.push(("example/self_test.c".to_owned(), self.filled(include_str!("self_test.c"))));
        }
        placed
    }

    fn of_rust(&self, files: Vec<(String, String)>) -> Vec<(String, String)> {
        let name = &self.name;
        let module = format!("#[allow(dead_code)]\nmod {name};\n");
        let placed = |(file, text): (String, String)| match file.as_str() {
            // The program names the modules of the crate.
            "main.rs" => {
                let text = text.replace(&module, &format!("use kalmems_{name}::{name};\n"));
                let test = format!("mod {name}_self_test;\n");
                (
                    "examples/run.rs".to_owned(),
                    text.replace(&test, &format!("use kalmems_{name}::{name}_self_test;\n")),
                )
            }
            _ => (format!("src/{file}"), text),
        };
        let mut placed: Vec<(String, String)> = files.into_iter().map(placed).collect();
        for (file, text) in OF_RUST {
            let module =
                if file == "src/lib.rs" && self.has_self_test { "pub mod @name@_self_test;\n" } else { "" };
            placed.push((file.to_owned(), self.filled(&format!("{text}{module}"))));
        }
        if self.has_self_test {
            let test = "#[test]\nfn it_is_the_filter_of_the_estimate() {\n    kalmems_@name@::@name@_self_test::self_test().unwrap();\n}\n";
            placed.push(("tests/self_test.rs".to_owned(), self.filled(test)));
        }
        placed
    }
}

/// A text that ends no comment, string or line.
fn plain(text: &str) -> String {
    let kept = |c: char| if c.is_ascii_alphanumeric() || " ,.-_".contains(c) { c } else { ' ' };
    text.chars().map(kept).collect()
}
