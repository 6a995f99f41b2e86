//! The engines, by what they have in common.

mod order_of_rooms;
mod workbench;
