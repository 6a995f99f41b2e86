#![no_std]
#![no_main]

#[unsafe(no_mangle)]
extern "C" fn main() -> ! {
    firmware::board::run::<firmware::text::FromText>()
}
