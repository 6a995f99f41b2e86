//! A program around a filter that reads samples.

use super::interface::{Interface, further};
use super::request::{EmitLanguage, EmitRequest};
use super::{c, rust};

/// The program, and the name of its file.
pub(super) fn file(request: &EmitRequest, interface: &Interface, language: EmitLanguage) -> (String, String) {
    let columns: Vec<&str> = interface.step.iter().chain(&interface.measured).map(String::as_str).collect();
    let columns = if columns.is_empty() { "nothing".to_owned() } else { columns.join(", ") };
    match language {
        EmitLanguage::C => ("main.c".to_owned(), in_c(request, interface, &columns)),
        EmitLanguage::Rust => ("main.rs".to_owned(), in_rust(request, interface, &columns)),
    }
}

fn in_c(request: &EmitRequest, interface: &Interface, columns: &str) -> String {
    let (name, states, count) = (&request.name, request.size(), count(interface));
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
    let read: Vec<String> = (0..count).map(|k| format!("scanf(\"%f\", &given[{k}]) == 1")).collect();
    format!(
        "{comment}/* Reads samples, each the numbers {columns}, and writes the states in SI behind each. */\n\
         #include \"{name}.h\"\n{include}#include <stdio.h>\n\nint main(void)\n{{\n    {name}_t filter;\n    float given[{count}];\n    \
         unsigned k;\n{test}    {name}_start(&filter);\n    while ({read}) {{\n        (void){name}_step(&filter{given});\n        \
         for (k = 0; k < {states}U; k++) {{\n            printf(\"%.9g%c\", (double){name}_value(&filter, k), k + 1U < {states}U ? ' ' : '\\n');\n        \
         }}\n    }}\n    return 0;\n}}\n",
        comment = c::comment(&interface.heading),
        read = read.join(" && "),
        given = further(&(0..count).map(|k| format!("given[{k}]")).collect::<Vec<_>>(), "", ""),
    )
}

fn in_rust(request: &EmitRequest, interface: &Interface, columns: &str) -> String {
    let (name, count) = (&request.name, count(interface));
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
    format!(
        "{comment}//!\n//! Reads samples, each the numbers {columns}, and writes the states in SI behind each.\n\n\
         #[allow(dead_code)]\nmod {name};\n{module}use std::io::Read;\n\nfn main() {{\n{test}    \
         let mut text = String::new();\n    if std::io::stdin().read_to_string(&mut text).is_err() {{\n        std::process::exit(2);\n    }}\n    \
         let given: Vec<f32> = text.split_whitespace().filter_map(|word| word.parse().ok()).collect();\n    \
         let mut filter = {name}::Filter::new();\n    for given in given.chunks_exact({count}) {{\n        let _ = filter.step({numbers});\n        \
         let values = filter.values().map(|value| format!(\"{{:e}}\", f64::from(value)));\n        \
         println!(\"{{}}\", values.join(\" \"));\n    }}\n}}\n",
        comment = rust::comment(&interface.heading),
        numbers = (0..count).map(|k| format!("given[{k}]")).collect::<Vec<_>>().join(", "),
    )
}

/// How many numbers a sample is.
fn count(interface: &Interface) -> usize {
    interface.step.len() + interface.measured.len()
}
