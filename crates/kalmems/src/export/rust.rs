//! The heading of a Rust module.

/// What stands above the module; `what` says what it is, `heading` where it is from.
pub fn module(what: &str, heading: &[String], body: &str) -> String {
    let comment: String = heading.iter().map(|line| format!("// {line}\n")).collect();
    format!("//! {what}\n\n{comment}\n{body}")
}
