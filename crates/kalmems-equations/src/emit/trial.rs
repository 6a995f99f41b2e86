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
    /// Where some rows are parts of an interval that are predicted alone, the place of the number that is below 0 in these.
    corrects: Option<usize>,
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
        let is_parted = vectors.samples.iter().any(TestSample::is_part);
        let corrects = is_parted.then_some(columns.len());
        let call = |of: String, arguments: &[String], only_where: Option<usize>| GivenCall {
            of,
            places: arguments.iter().filter_map(find).collect(),
            only_where,
        };
        let mut calls = Vec::new();
        if request.events.is_empty() && !is_parted {
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
                calls.push(call(of, &arguments, ago.or(corrects)));
            }
        }
        let points = ["start", "middle", "end"];
        let all: Vec<(usize, usize)> =
            (0..device.inputs.len()).flat_map(|k| (0..points.len()).map(move |point| (k, point))).collect();
        let name =
            |(k, point): (usize, usize)| program.names.input(k, points.get(point).copied().unwrap_or(""));
        let from = |wanted: &String| all.iter().copied().find(|place| name(*place) == *wanted);
        let sources: Vec<(usize, usize)> = inputs.iter().filter_map(from).collect();
        let row = |sample: &TestSample| {
            let at = |(k, point): &(usize, usize)| {
                sample.inputs.get(*point).and_then(|inputs| inputs.get(*k)).copied()
            };
            let measured =
                (0..request.measures.len()).map(|k| sample.measured.get(k).copied().unwrap_or(0.0));
            let ago =
                (0..request.events.len()).map(|k| sample.events.get(k).copied().flatten().unwrap_or(-1.0));
            let corrects = corrects.map(|_| if sample.is_part() { -1.0 } else { 1.0 });
            sources.iter().filter_map(at).chain(measured).chain(ago).chain(corrects).collect()
        };
        Self { rows: vectors.samples.iter().map(row).collect(), calls, corrects }
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
        let expected = vectors.samples.iter().map(|sample| match sample.expected.as_slice() {
            [] => vec![0.0; request.size()],
            expected => expected.to_vec(),
        });
        let expected: Vec<Vec<f64>> = expected.collect();
        let sizes = sizes(vectors, request.size());
        match language {
            EmitLanguage::C => {
                files.extend(self_test_in_c(request, &interface, (&given, &expected, &sizes), vectors)?);
            }
            EmitLanguage::Rust => {
                files.push(self_test_in_rust(request, &interface, (&given, &expected, &sizes), vectors)?);
            }
        }
    }
    files.push(example_program::file(device, (request, program), &interface, language));
    Ok(files)
}

type Vectors<'a> = (&'a TestInputs, &'a [Vec<f64>], &'a [f64]);

fn self_test_in_c(
    request: &EmitRequest,
    interface: &Interface,
    (given, expected, sizes): Vectors<'_>,
    vectors: &TestVectors,
) -> Result<Vec<(String, String)>, EmitError> {
    let name = &request.name;
    let upper = name.to_uppercase();
    let samples = vectors.samples.iter().filter(|sample| !sample.is_part()).count();
    let (count, arguments, states) =
        (given.rows.len(), given.rows.first().map_or(0, Vec::len), request.size());
    let call = |call: &GivenCall| {
        let (of, arguments) = (&call.of, call.arguments("GIVEN[k]"));
        let arguments = if arguments.is_empty() { arguments } else { format!(", {arguments}") };
        let where_it_was =
            call.only_where("GIVEN[k]").map_or(String::new(), |ago| format!("{ago} >= 0.0F && "));
        format!(
            "        if ({where_it_was}!{name}_{of}(&filter{arguments})) {{\n            return 0;\n        }}\n"
        )
    };
    let calls: String = given.calls.iter().map(call).collect();
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
         /* The largest expected size of each state. */\nstatic const float SIZE[{states}] = {{\n{sizes}}};\n\n\
         int {name}_self_test(float *worst)\n{{\n    {name}_t filter;\n    unsigned k, i;\n    *worst = 0.0F;\n    {name}_start(&filter);\n    \
         for (k = 0; k < {count}U; k++) {{\n{calls}{skip}        \
         for (i = 0; i < {states}U; i++) {{\n            const float difference = {name}_value(&filter, i) - EXPECTED[k][i];\n            \
             const float error = (difference < 0.0F ? -difference : difference) / SIZE[i];\n            \
             if (!(error <= *worst)) {{\n                *worst = error;\n            }}\n        }}\n    }}\n    \
         return *worst <= {tolerance};\n}}\n",
        comment = c::comment(&interface.heading),
        given = table(&given.rows, ['{', '}'], EmitLanguage::C)?,
        expected = table(expected, ['{', '}'], EmitLanguage::C)?,
        sizes = table(&[sizes.to_vec()], [' ', ' '], EmitLanguage::C)?.replace(" ,\n", "\n"),
        calls = calls,
        skip = given.corrects.map_or(String::new(), |k| format!(
            "        if (GIVEN[k][{k}] < 0.0F) {{\n            continue;\n        }}\n"
        )),
        tolerance = c::float(vectors.tolerance)?
    );
    Ok(vec![(format!("{name}_self_test.h"), header), (format!("{name}_self_test.c"), source)])
}

fn self_test_in_rust(
    request: &EmitRequest,
    interface: &Interface,
    (given, expected, sizes): Vectors<'_>,
    vectors: &TestVectors,
) -> Result<(String, String), EmitError> {
    let name = &request.name;
    let (count, arguments, states) =
        (given.rows.len(), given.rows.first().map_or(0, Vec::len), request.size());
    let call = |call: &GivenCall| {
        let (of, arguments) = (&call.of, call.arguments("given"));
        let where_it_was = call.only_where("given").map_or(String::new(), |ago| format!("{ago} >= 0.0 && "));
        format!(
            "        if {where_it_was}!filter.{of}({arguments}) {{\n            return Err(f32::INFINITY);\n        }}\n"
        )
    };
    let calls: String = given.calls.iter().map(call).collect();
    let text = format!(
        "{comment}\nuse super::{name}::Filter;\n\n\
         /// Inputs and measurements in SI.\nstatic GIVEN: [[f32; {arguments}]; {count}] = [\n{given}];\n\n\
         /// The states in SI that are expected behind each sample.\nstatic EXPECTED: [[f32; {states}]; {count}] = [\n{expected}];\n\n\
         /// The largest expected size of each state.\nstatic SIZE: [f32; {states}] = [\n{sizes}];\n\n\
         /// Runs the filter over the samples. The largest difference from what is expected, relative to the largest expected size of\n\
         /// each state: in `Ok` where it is within {tolerance}.\npub fn self_test() -> Result<f32, f32> {{\n    \
         let mut filter = Filter::new();\n    let mut worst = 0.0;\n    for (given, expected) in GIVEN.iter().zip(&EXPECTED) {{\n\
         {calls}{skip}        \
         for ((value, expected), size) in filter.values().iter().zip(expected).zip(&SIZE) {{\n            \
         let difference = value - expected;\n            let error = (if difference < 0.0 {{ -difference }} else {{ difference }}) / size;\n            \
         if !(error <= worst) {{\n                worst = error;\n            }}\n        }}\n    }}\n    \
         if worst <= {tolerance} {{ Ok(worst) }} else {{ Err(worst) }}\n}}\n",
        comment = rust::comment(&interface.heading),
        given = table(&given.rows, ['[', ']'], EmitLanguage::Rust)?,
        expected = table(expected, ['[', ']'], EmitLanguage::Rust)?,
        sizes = table(&[sizes.to_vec()], [' ', ' '], EmitLanguage::Rust)?.replace(" ,\n", "\n"),
        calls = calls,
        skip = given.corrects.map_or(String::new(), |k| format!(
            "        if given[{k}] < 0.0 {{\n            continue;\n        }}\n"
        )),
        tolerance = rust::float(vectors.tolerance)?
    );
    Ok((format!("{name}_self_test.rs"), text))
}
