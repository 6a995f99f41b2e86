//! The engines, by what they have in common.

mod allan;
mod order_of_rooms;
mod workbench;
