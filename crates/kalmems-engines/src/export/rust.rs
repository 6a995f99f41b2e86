//! The heading of a Rust module.

/// What stands above the module; `what` says what it is, `heading` where it is from.
pub fn module(what: &str, heading: &[String], body: &str) -> String {
    format!("//! {what}\n\n// {}\n\n{body}", heading.join("\n// "))
}
