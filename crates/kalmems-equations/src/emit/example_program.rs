//! A program around a filter that reads samples.

use super::filter::FilterProgram;
use super::interface::Interface;
use super::request::{EmitLanguage, EmitRequest, InputCourse};
use super::{c, rust};
use crate::device::Device;
use std::fmt::Write as _;

/// The points of an interval at which an input may be asked for, in parts of it.
const POINTS: [(&str, f64); 3] = [("start", 0.0), ("middle", 0.5), ("end", 1.0)];

/// The numbers of a sample in their order: the inputs over the interval before it, and what is measured.
struct SampleNumbers {
    /// Of each input of the device the places of those at the points of the interval that a step asks for.
    inputs: Vec<[Option<usize>; 3]>,
    /// The names of inputs at points, and the input and the point of each.
    names: Vec<(String, usize, usize)>,
    /// How many numbers of inputs there are, and of measurements behind them.
    counts: [usize; 2],
    /// How each input goes between two samples.
    courses: Vec<InputCourse>,
}

impl SampleNumbers {
    fn of(device: &Device, program: &FilterProgram, interface: &Interface) -> Self {
        let (mut inputs, mut names): (Vec<_>, Vec<(String, usize, usize)>) = (Vec::new(), Vec::new());
        for input in 0..device.inputs.len() {
            let mut places = [None; 3];
            for (point, (word, _)) in POINTS.iter().enumerate() {
                let name = program.names.input(input, word);
                // One that is held has the same name at two points.
                if names.iter().all(|(own, ..)| *own != name) {
                    places[point] = interface.step.iter().position(|own| *own == name);
                    names.push((name, input, point));
                }
            }
            inputs.push(places);
        }
        let courses = (0..device.inputs.len()).map(|input| program.names.course(input)).collect();
        Self { inputs, names, counts: [interface.step.len(), interface.measured.len()], courses }
    }

    /// The arguments of a prediction or a step over a part of the interval that begins at `from`, an expression, and has this length:
    /// between the points that are given an input is a parabola or a line, and one that is given at one point is held.
    fn arguments(
        &self,
        wanted: &[String],
        (from, length): (&str, f64),
        digits: &dyn Fn(f64) -> String,
    ) -> Vec<String> {
        let of = |name: &String| {
            let (_, input, point) = self.names.iter().find(|(own, ..)| own == name)?;
            let place = format!("{from} + {}", digits(POINTS[*point].1 * length));
            let given = |k: usize| format!("given[{k}]");
            let held = self.courses[*input] != InputCourse::Between && POINTS[*point].0 != "end";
            if held && let Some(k) = self.inputs[*input][*point] {
                return Some(given(k));
            }
            Some(match self.inputs[*input] {
                [Some(start), Some(middle), Some(end)] => {
                    format!("between({}, {}, {}, {place})", given(start), given(middle), given(end))
                }
                [Some(start), None, Some(end)] => {
                    format!("{0} + ({1} - {0}) * ({place})", given(start), given(end))
                }
                places => given(places.into_iter().flatten().next()?),
            })
        };
        wanted.iter().filter_map(of).collect()
    }

    /// What a sample hands to the predictions before its step, where it takes several, and to the step.
    fn calls(
        &self,
        request: &EmitRequest,
        interface: &Interface,
        digits: &dyn Fn(f64) -> String,
    ) -> (Option<PartCalls>, Vec<String>) {
        if request.parts == 1 {
            return (None, (0..self.count()).map(|k| format!("given[{k}]")).collect());
        }
        let length = 1.0 / request.parts as f64;
        let arguments = self.arguments(&interface.predict, ("from", length), digits);
        let asks_where = arguments.iter().any(|argument| argument.contains("from"));
        let mut step = self.arguments(&interface.step, (&digits(1.0 - length), length), digits);
        step.extend(self.measured());
        (Some(PartCalls { count: request.parts - 1, length: digits(length), arguments, asks_where }), step)
    }

    fn has_parabola(&self) -> bool {
        self.inputs.iter().any(|places| places.iter().all(Option::is_some))
    }

    fn measured(&self) -> impl Iterator<Item = String> {
        let [inputs, measured] = self.counts;
        (inputs..inputs + measured).map(|k| format!("given[{k}]"))
    }

    fn count(&self) -> usize {
        self.counts.iter().sum()
    }
}

/// The predictions before a step.
struct PartCalls {
    count: usize,
    /// The length of each in parts of the interval between samples, as it is written.
    length: String,
    arguments: Vec<String>,
    /// Whether they need to know in which part they are.
    asks_where: bool,
}

/// The program, and the name of its file.
pub(super) fn file(
    device: &Device,
    (request, program): (&EmitRequest, &FilterProgram),
    interface: &Interface,
    language: EmitLanguage,
) -> (String, String) {
    let numbers = SampleNumbers::of(device, program, interface);
    let columns: Vec<&str> = interface.step.iter().chain(&interface.measured).map(String::as_str).collect();
    let columns = if columns.is_empty() { "nothing".to_owned() } else { columns.join(", ") };
    match language {
        EmitLanguage::C => ("main.c".to_owned(), in_c(request, interface, &numbers, &columns)),
        EmitLanguage::Rust => ("main.rs".to_owned(), in_rust(request, interface, &numbers, &columns)),
    }
}

/// What a program says of its inputs where a sample takes several predictions.
const PARTS: &str =
    "A sample takes several predictions; its inputs are those over the interval between samples.";

fn in_c(request: &EmitRequest, interface: &Interface, numbers: &SampleNumbers, columns: &str) -> String {
    let (name, states, count) = (&request.name, request.size(), numbers.count());
    let (include, test) = if request.vectors.is_some() {
        (
            format!("#include \"{name}_self_test.h\"\n"),
            format!(
                "    float worst;\n    if (!{name}_self_test(&worst)) {{\n        \
                 fprintf(stderr, \"the self-test failed: %g\\n\", (double)worst);\n        return 1;\n    }}\n"
            ),
        )
    } else {
        (String::new(), String::new())
    };
    let call = |of: &str, arguments: Vec<String>| {
        let all: Vec<String> = std::iter::once("&filter".to_owned()).chain(arguments).collect();
        format!("(void){name}_{of}({});\n", all.join(", "))
    };
    let (mut about, mut helper, mut variable, mut steps) = (String::new(), "", "", String::new());
    let digits = |x: f64| c::float(x).unwrap_or_else(|_| format!("{x}F"));
    let (parts, step) = numbers.calls(request, interface, &digits);
    if let Some(PartCalls { count, length, arguments, asks_where }) = parts {
        about = format!("/* {PARTS} */\n");
        if numbers.has_parabola() {
            helper = "/* A number between those at the start, the middle and the end, by a parabola. */\n\
                      static float between(float start, float middle, float end, float place)\n{\n    \
                      return start + place * (4.0F * middle - 3.0F * start - end + 2.0F * place * (start - 2.0F * middle + end));\n}\n\n";
        }
        variable = "    unsigned part;\n";
        let from = format!("            const float from = (float)part * {length};\n");
        let from = if asks_where { &*from } else { "" };
        let predict = call("predict", arguments);
        steps = format!(
            "        for (part = 0; part < {count}U; part++) {{\n{from}            {predict}        }}\n"
        );
    }
    let _ = write!(steps, "        {}", call("step", step));
    let read: Vec<String> = (0..count).map(|k| format!("scanf(\"%f\", &given[{k}]) == 1")).collect();
    format!(
        "{comment}/* Reads samples, each the numbers {columns}, and writes the states in SI behind each. */\n{about}\
         #include \"{name}.h\"\n{include}#include <stdio.h>\n\n{helper}int main(void)\n{{\n    {name}_t filter;\n    float given[{count}];\n    \
         unsigned k;\n{variable}{test}    {name}_start(&filter);\n    while ({read}) {{\n{steps}        \
         for (k = 0; k < {states}U; k++) {{\n            printf(\"%.9g%c\", (double){name}_value(&filter, k), k + 1U < {states}U ? ' ' : '\\n');\n        \
         }}\n    }}\n    return 0;\n}}\n",
        comment = c::comment(&interface.heading),
        read = read.join(" && "),
    )
}

fn in_rust(request: &EmitRequest, interface: &Interface, numbers: &SampleNumbers, columns: &str) -> String {
    let (name, count) = (&request.name, numbers.count());
    let (module, test) = if request.vectors.is_some() {
        (
            format!("mod {name}_self_test;\n"),
            format!(
                "    if let Err(worst) = {name}_self_test::self_test() {{\n        \
                 eprintln!(\"the self-test failed: {{worst}}\");\n        std::process::exit(1);\n    }}\n"
            ),
        )
    } else {
        (String::new(), String::new())
    };
    let call = |of: &str, arguments: Vec<String>| format!("let _ = filter.{of}({});\n", arguments.join(", "));
    let (mut about, mut helper, mut steps) = (String::new(), "", String::new());
    let digits = |x: f64| rust::float(x).unwrap_or_else(|_| format!("{x}"));
    let (parts, step) = numbers.calls(request, interface, &digits);
    if let Some(PartCalls { count, length, arguments, asks_where }) = parts {
        about = format!("//! {PARTS}\n");
        if numbers.has_parabola() {
            helper = "/// A number between those at the start, the middle and the end, by a parabola.\n\
                      fn between(start: f32, middle: f32, end: f32, place: f32) -> f32 {\n    \
                      start + place * (4.0 * middle - 3.0 * start - end + 2.0 * place * (start - 2.0 * middle + end))\n}\n\n";
        }
        let from = format!("            let from = part as f32 * {length};\n");
        let (variable, from) = if asks_where { ("part", &*from) } else { ("_", "") };
        let predict = call("predict", arguments);
        steps = format!("        for {variable} in 0..{count} {{\n{from}            {predict}        }}\n");
    }
    let _ = write!(steps, "        {}", call("step", step));
    format!(
        "{comment}//!\n//! Reads samples, each the numbers {columns}, and writes the states in SI behind each.\n{about}\n\
         #[allow(dead_code)]\nmod {name};\n{module}use std::io::Read;\n\n{helper}fn main() {{\n{test}    \
         let mut text = String::new();\n    if std::io::stdin().read_to_string(&mut text).is_err() {{\n        std::process::exit(2);\n    }}\n    \
         let given: Vec<f32> = text.split_whitespace().filter_map(|word| word.parse().ok()).collect();\n    \
         let mut filter = {name}::Filter::new();\n    for given in given.chunks_exact({count}) {{\n{steps}        \
         let values = filter.values().map(|value| format!(\"{{value:e}}\"));\n        \
         println!(\"{{}}\", values.join(\" \"));\n    }}\n}}\n",
        comment = rust::comment(&interface.heading),
    )
}
