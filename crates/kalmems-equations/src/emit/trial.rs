//! A filter's test of itself.

use super::error::EmitError;
use super::filter::FilterProgram;
use super::interface::Interface;
use super::request::{EmitLanguage, EmitRequest, TestSample, TestVectors};
use super::{c, example_program, rust};
use crate::device::Device;
use std::fmt::Write as _;

/// What a test hands to a filter, and how it calls it.
struct TestInputs {
    /// The numbers of each sample: inputs, measurements, and how long ago each event was, below 0 where it was not.
    rows: Vec<Vec<f64>>,
    /// The functions of a sample in their order, with the places of what they take.
    calls: Vec<GivenCall>,
}

struct GivenCall {
    of: String,
    places: Vec<usize>,
    /// The place of the number that is below 0 where it is not called.
    only_where: Option<usize>,
}

impl TestInputs {
    fn of(
        device: &Device,
        program: &FilterProgram,
        interface: &Interface,
        request: &EmitRequest,
        vectors: &TestVectors,
    ) -> Self {
        let mut inputs = interface.step.clone();
        let of_updates: Vec<Vec<String>> =
            program.updates.iter().map(|update| Interface::inputs_of(device, program, update)).collect();
        for input in of_updates.iter().flatten() {
            if !inputs.contains(input) {
                inputs.push(input.clone());
            }
        }
        let places: Vec<usize> = (0..request.measures.len() + request.events.len()).collect();
        let columns: Vec<String> =
            inputs.iter().cloned().chain(places.iter().map(|k| program.names.measured(*k))).collect();
        let find = |of: &String| columns.iter().position(|column| column == of);
        let call = |of: String, arguments: &[String], only_where: Option<usize>| GivenCall {
            of,
            places: arguments.iter().filter_map(find).collect(),
            only_where,
        };
        let mut calls = Vec::new();
        if request.events.is_empty() {
            let step: Vec<String> = interface.step.iter().chain(&interface.measured).cloned().collect();
            calls.push(call("step".to_owned(), &step, None));
        } else {
            calls.push(call("predict".to_owned(), &interface.predict, None));
            // Events come before what is measured at the sample.
            let (measures, events) = places.split_at(request.measures.len());
            for place in events.iter().chain(measures) {
                let mut arguments = of_updates.get(*place).cloned().unwrap_or_default();
                arguments.push(program.names.measured(*place));
                let of = format!("update_{}", program.names.measure(*place));
                let ago = arguments.last().and_then(find).filter(|_| *place >= request.measures.len());
                calls.push(call(of, &arguments, ago));
            }
        }
        let sources = Interface::points_of(device, program, &inputs);
        let row = |sample: &TestSample| {
            let at = |(k, point): &(usize, usize)| {
                sample.inputs.get(*point).and_then(|inputs| inputs.get(*k)).copied()
            };
            let measured =
                (0..request.measures.len()).map(|k| sample.measured.get(k).copied().unwrap_or(0.0));
            let ago =
                (0..request.events.len()).map(|k| sample.events.get(k).copied().flatten().unwrap_or(-1.0));
            sources.iter().filter_map(at).chain(measured).chain(ago).collect()
        };
        Self { rows: vectors.samples.iter().map(row).collect(), calls }
    }
}

impl GivenCall {
    /// What it takes of the numbers of a sample with this name.
    fn arguments(&self, given: &str) -> String {
        self.places.iter().map(|k| format!("{given}[{k}]")).collect::<Vec<_>>().join(", ")
    }

    /// The number that is below 0 where it is not called.
    fn only_where(&self, given: &str) -> Option<String> {
        self.only_where.map(|k| format!("{given}[{k}]"))
    }
}

/// The largest expected size of each state.
fn sizes(vectors: &TestVectors, count: usize) -> Vec<f64> {
    let size = |k: usize| {
        let values = vectors.samples.iter().filter_map(|sample| sample.expected.get(k));
        let size = values.fold(0.0_f64, |size, value| size.max(value.abs()));
        if size > 0.0 { size } else { 1.0 }
    };
    (0..count).map(size).collect()
}

/// Numbers of 32 bits in rows, where what they do not hold is 0.
fn table(rows: &[Vec<f64>], [open, close]: [char; 2], language: EmitLanguage) -> Result<String, EmitError> {
    let mut text = String::new();
    for row in rows {
        let number = |value: &f64| {
            let value = if value.abs() < f64::from(f32::MIN_POSITIVE) { 0.0 } else { *value };
            if language == EmitLanguage::C { c::float(value) } else { rust::float(value) }
        };
        let numbers = row.iter().map(number).collect::<Result<Vec<_>, _>>()?;
        let _ = writeln!(text, "    {open}{}{close},", numbers.join(", "));
    }
    Ok(text)
}

/// One row of such numbers without brackets.
fn row(values: &[f64], language: EmitLanguage) -> Result<String, EmitError> {
    Ok(table(&[values.to_vec()], [' ', ' '], language)?.replace(" ,\n", "\n"))
}

/// The files around a filter: its test of itself where it has vectors, and a program that reads samples.
pub(super) fn files(
    device: &Device,
    request: &EmitRequest,
    program: &FilterProgram,
    language: EmitLanguage,
) -> Result<Vec<(String, String)>, EmitError> {
    let interface = Interface::of(device, request, program);
    let mut files = Vec::new();
    if let Some(vectors) = &request.vectors {
        let given = TestInputs::of(device, program, &interface, request, vectors);
        let mut periods = vec![0.0; request.size()];
        for (state, period) in device.periods(&request.parameters)? {
            periods[state] = period;
        }
        let expected = Expectations {
            rows: vectors.samples.iter().map(|sample| sample.expected.clone()).collect(),
            sizes: sizes(vectors, request.size()),
            periods,
        };
        match language {
            EmitLanguage::C => {
                files.extend(self_test_in_c(request, &interface, (&given, &expected), vectors)?);
            }
            EmitLanguage::Rust => {
                files.push(self_test_in_rust(request, &interface, (&given, &expected), vectors)?);
            }
        }
    }
    files.push(example_program::file(request, &interface, language));
    Ok(files)
}

/// What a test expects.
struct Expectations {
    /// The states in SI behind each sample.
    rows: Vec<Vec<f64>>,
    /// The largest size of each.
    sizes: Vec<f64>,
    /// The period of each state that comes round, and 0 of the others.
    periods: Vec<f64>,
}

/// The difference of a state that comes round, without whole periods.
const WRAP_IN_C: &str = "            if (difference > 0.5F * PERIOD[i]) {\n                difference -= PERIOD[i];\n            } else if (difference < -0.5F * PERIOD[i]) {\n                \
                         difference += PERIOD[i];\n            }\n";
const WRAP_IN_RUST: &str = "            if difference > 0.5 * PERIOD[k] {\n                difference -= PERIOD[k];\n            } else if difference < -0.5 * PERIOD[k] {\n                \
                            difference += PERIOD[k];\n            }\n";

fn self_test_in_c(
    request: &EmitRequest,
    interface: &Interface,
    (given, Expectations { rows: expected, sizes, periods }): (&TestInputs, &Expectations),
    vectors: &TestVectors,
) -> Result<Vec<(String, String)>, EmitError> {
    let name = &request.name;
    let upper = name.to_uppercase();
    let samples = vectors.samples.len();
    let (count, arguments, states) =
        (given.rows.len(), given.rows.first().map_or(0, Vec::len), request.size());
    let call = |call: &GivenCall| {
        let (of, arguments) = (&call.of, call.arguments("GIVEN[k]"));
        let arguments = if arguments.is_empty() { arguments } else { format!(", {arguments}") };
        let one = format!("(void){name}_{of}(&filter{arguments});\n");
        match call.only_where("GIVEN[k]") {
            Some(ago) => format!("        if ({ago} >= 0.0F) {{\n            {one}        }}\n"),
            None => format!("        {one}"),
        }
    };
    let calls: String = given.calls.iter().map(call).collect();
    let comes_round = periods.iter().any(|period| *period > 0.0);
    let periods = if comes_round {
        let periods = row(periods, EmitLanguage::C)?;
        format!(
            "/* The period of each state that comes round; 0 of the others. */\nstatic const float PERIOD[{states}] = {{\n{periods}}};\n\n"
        )
    } else {
        String::new()
    };
    let header = format!(
        "{comment}#ifndef {upper}_SELF_TEST_H\n#define {upper}_SELF_TEST_H\n\n#ifdef __cplusplus\nextern \"C\" {{\n#endif\n\n\
         /*\n * Runs the filter over {samples} samples. 1 where every state stays within {tolerance:e} of what is expected, relative to its\n \
         * largest expected size. The largest difference is in *worst.\n */\nint {name}_self_test(float *worst);\n\n\
         #ifdef __cplusplus\n}}\n#endif\n\n#endif\n",
        comment = c::comment(&interface.heading),
        tolerance = vectors.tolerance
    );
    let source = format!(
        "{comment}#include \"{name}_self_test.h\"\n#include \"{name}.h\"\n\n\
         /* Inputs and measurements in SI. */\nstatic const float GIVEN[{count}][{arguments}] = {{\n{given}}};\n\n\
         /* The states in SI that are expected behind each sample. */\nstatic const float EXPECTED[{count}][{states}] = {{\n{expected}}};\n\n\
         /* The largest expected size of each state. */\nstatic const float SIZE[{states}] = {{\n{sizes}}};\n\n{periods}\
         int {name}_self_test(float *worst)\n{{\n    {name}_t filter;\n    unsigned k, i;\n    *worst = 0.0F;\n    {name}_start(&filter);\n    \
         for (k = 0; k < {count}U; k++) {{\n{calls}        \
         for (i = 0; i < {states}U; i++) {{\n            {constant}float difference = {name}_value(&filter, i) - EXPECTED[k][i];\n{wrap}            \
             const float error = (difference < 0.0F ? -difference : difference) / SIZE[i];\n            \
             if (!(error <= *worst)) {{\n                *worst = error;\n            }}\n        }}\n    }}\n    \
         return *worst <= {tolerance};\n}}\n",
        comment = c::comment(&interface.heading),
        given = table(&given.rows, ['{', '}'], EmitLanguage::C)?,
        expected = table(expected, ['{', '}'], EmitLanguage::C)?,
        sizes = row(sizes, EmitLanguage::C)?,
        periods = periods,
        constant = if comes_round { "" } else { "const " },
        wrap = if comes_round { WRAP_IN_C } else { "" },
        calls = calls,
        tolerance = c::float(vectors.tolerance)?
    );
    Ok(vec![(format!("{name}_self_test.h"), header), (format!("{name}_self_test.c"), source)])
}

fn self_test_in_rust(
    request: &EmitRequest,
    interface: &Interface,
    (given, Expectations { rows: expected, sizes, periods }): (&TestInputs, &Expectations),
    vectors: &TestVectors,
) -> Result<(String, String), EmitError> {
    let name = &request.name;
    let (count, arguments, states) =
        (given.rows.len(), given.rows.first().map_or(0, Vec::len), request.size());
    let call = |call: &GivenCall| {
        let (of, arguments) = (&call.of, call.arguments("given"));
        let one = format!("let _ = filter.{of}({arguments});\n");
        match call.only_where("given") {
            Some(ago) => format!("        if {ago} >= 0.0 {{\n            {one}        }}\n"),
            None => format!("        {one}"),
        }
    };
    let calls: String = given.calls.iter().map(call).collect();
    let comes_round = periods.iter().any(|period| *period > 0.0);
    let each = if comes_round {
        "for (k, ((value, expected), size)) in filter.values().iter().zip(expected).zip(&SIZE).enumerate() {"
    } else {
        "for ((value, expected), size) in filter.values().iter().zip(expected).zip(&SIZE) {"
    };
    let (periods, constant, wrap) = if comes_round {
        let periods = row(periods, EmitLanguage::Rust)?;
        let what = "/// The period of each state that comes round; 0 of the others.";
        (format!("{what}\nstatic PERIOD: [f32; {states}] = [\n{periods}];\n\n"), "mut ", WRAP_IN_RUST)
    } else {
        (String::new(), "", "")
    };
    let text = format!(
        "{comment}\nuse super::{name}::Filter;\n\n\
         /// Inputs and measurements in SI.\nstatic GIVEN: [[f32; {arguments}]; {count}] = [\n{given}];\n\n\
         /// The states in SI that are expected behind each sample.\nstatic EXPECTED: [[f32; {states}]; {count}] = [\n{expected}];\n\n\
         /// The largest expected size of each state.\nstatic SIZE: [f32; {states}] = [\n{sizes}];\n\n{periods}\
         /// Runs the filter over the samples. The largest difference from what is expected, relative to the largest expected size of\n\
         /// each state: in `Ok` where it is within {tolerance}.\npub fn self_test() -> Result<f32, f32> {{\n    \
         let mut filter = Filter::new();\n    let mut worst = 0.0;\n    for (given, expected) in GIVEN.iter().zip(&EXPECTED) {{\n\
         {calls}        \
         {each}\n            \
         let {constant}difference = value - expected;\n{wrap}            let error = (if difference < 0.0 {{ -difference }} else {{ difference }}) / size;\n            \
         if !(error <= worst) {{\n                worst = error;\n            }}\n        }}\n    }}\n    \
         if worst <= {tolerance} {{ Ok(worst) }} else {{ Err(worst) }}\n}}\n",
        comment = rust::comment(&interface.heading),
        given = table(&given.rows, ['[', ']'], EmitLanguage::Rust)?,
        expected = table(expected, ['[', ']'], EmitLanguage::Rust)?,
        sizes = row(sizes, EmitLanguage::Rust)?,
        periods = periods,
        calls = calls,
        tolerance = rust::float(vectors.tolerance)?
    );
    Ok((format!("{name}_self_test.rs"), text))
}
