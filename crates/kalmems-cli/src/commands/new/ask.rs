//! What somebody at a terminal is asked.

use super::wrong;
use crate::CommandEnding;
use crate::tell::{line, visible};
use kalmems::draft::{DeviceFit, DraftError, Question, operator_numbers};
use kalmems::inspect::UnitlessTime;
use kalmems::rigs::Workbench;
use std::io::{BufRead, IsTerminal, Write};

/// Whether somebody is there to answer.
pub fn is_answered() -> bool {
    std::io::stdin().is_terminal() && std::io::stderr().is_terminal()
}

/// Prints a prompt and reads a line; `None` at the end of the input.
fn answer(prompt: &str) -> Result<Option<String>, CommandEnding> {
    let failed = |e: std::io::Error| CommandEnding::Wrong(format!("no answer: {e}"));
    let mut to = std::io::stderr().lock();
    write!(to, "{}", visible(prompt)).and_then(|()| to.flush()).map_err(failed)?;
    let mut answer = String::new();
    let read = std::io::stdin().lock().read_line(&mut answer).map_err(failed)?;
    Ok((read > 0).then(|| answer.trim().to_owned()))
}

/// Asks until one of the choices is named, by its place in the list or by its name.
fn choice<'a>(choices: &[&'a str]) -> Result<Option<&'a str>, CommandEnding> {
    loop {
        let Some(answer) = answer("its number or name: ")? else { return Ok(None) };
        let by_number = answer.parse::<usize>().ok().and_then(|number| number.checked_sub(1));
        let by_number = by_number.and_then(|index| choices.get(index));
        if let Some(found) = by_number.or_else(|| choices.iter().find(|choice| **choice == answer)) {
            return Ok(Some(found));
        }
    }
}

/// Asks the first question, where somebody is there to answer it; a channel and its column.
pub fn column(questions: &[Question]) -> Result<Option<(String, String)>, CommandEnding> {
    let Some(question) = questions.first().filter(|question| !question.candidates.is_empty()) else {
        return Ok(None);
    };
    if !is_answered() {
        return Ok(None);
    }
    line(format_args!("Which column of {} is `{}`, {}?", question.file, question.meaning, question.what));
    for (index, column) in question.candidates.iter().enumerate() {
        line(format_args!("  {}: {column}", index + 1));
    }
    let choices: Vec<&str> = question.candidates.iter().map(String::as_str).collect();
    Ok(choice(&choices)?.map(|column| (question.meaning.to_owned(), column.to_owned())))
}

/// Asks which of the devices was recorded.
pub fn device(fits: &[DeviceFit]) -> Result<Option<String>, CommandEnding> {
    line(format_args!("Which device was recorded?"));
    let possible: Vec<&DeviceFit> = fits.iter().filter(|fit| fit.is_possible()).collect();
    for (index, fit) in possible.iter().enumerate() {
        line(format_args!("  {}: {}: {}", index + 1, fit.name, fit.description));
    }
    let choices: Vec<&str> = possible.iter().map(|fit| fit.name).collect();
    Ok(choice(&choices)?.map(str::to_owned))
}

/// What somebody answers of a column that may be the time.
pub enum TimeAnswer {
    /// Its unit.
    Unit(String),
    /// It is no time, and this is the rate of the samples.
    Rate(String),
}

/// Asks for the unit of a column that may be the time.
pub fn time(file: &str, found: &UnitlessTime) -> Result<Option<TimeAnswer>, CommandEnding> {
    line(format_args!("{file}: {} What is its unit?", found.sentence()));
    let units = found.units();
    for (index, unit) in units.iter().enumerate() {
        let rate = found.rate_in(unit).unwrap_or_default();
        line(format_args!("  {}: {unit}, so that the samples follow each other at {rate}", index + 1));
    }
    let none = "none";
    line(format_args!("  {}: {none}: it is no time", units.len() + 1));
    let choices: Vec<&str> = units.into_iter().chain([none]).collect();
    Ok(match choice(&choices)? {
        Some(unit) if unit != none => Some(TimeAnswer::Unit(unit.to_owned())),
        Some(_) => rate(file)?.map(TimeAnswer::Rate),
        None => None,
    })
}

/// Asks for the rate of the samples of a recording without times.
pub fn rate(file: &str) -> Result<Option<String>, CommandEnding> {
    let rate = answer(&format!("{file} has no column of times. Its sampling rate, such as 1 MHz: "))?;
    Ok(rate.filter(|rate| !rate.is_empty()))
}

/// Asks for each number that no recording shows, and tries each answer; an empty one leaves the published number.
pub fn numbers(
    workbench: &Workbench,
    device: &str,
    stated: &mut Vec<(String, String)>,
    mut try_numbers: impl FnMut(&[(String, String)]) -> Result<(), DraftError>,
) -> Result<(), CommandEnding> {
    if !is_answered() {
        return Ok(());
    }
    let asked = operator_numbers(workbench, device).map_err(wrong)?;
    let is_stated = |key: &str| stated.iter().any(|(stated, _)| key.ends_with(stated.as_str()));
    let asked: Vec<_> = asked.into_iter().filter(|number| !is_stated(&number.key)).collect();
    if asked.is_empty() {
        return Ok(());
    }
    line(format_args!(
        "No recording shows the following numbers. Enter alone keeps that of the published device."
    ));
    for number in asked {
        line(format_args!("`{}`: {}", number.key, number.why));
        loop {
            let Some(value) = answer(&format!("{} [{}]: ", number.key, number.value))? else { return Ok(()) };
            if value.is_empty() {
                break;
            }
            stated.push((number.key.clone(), value));
            match try_numbers(stated) {
                Ok(()) => break,
                Err(error) => {
                    line(format_args!("{error}"));
                    stated.pop();
                }
            }
        }
    }
    Ok(())
}
