//! The rigs behind the words of an experiment file.

mod engines;
mod equations_table;
mod experiment_texts;
mod methods;
