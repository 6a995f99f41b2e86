//! To be written below.
#![no_std]
