//! The rigs behind the words of an experiment file.

mod compensation;
mod engines;
mod equations_table;
mod experiment_texts;
mod methods;
mod sweep;
