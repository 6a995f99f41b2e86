//! What the paper prints.

/// P section II-C and II-D.
pub mod circuit {
    /// In V.
    pub const EXCITATION: f64 = 1.0;
    /// In Hz.
    pub const CARRIER_HZ: f64 = 20e6;
    /// In Ω.
    pub const SHUNT: f64 = 50.0;
    /// In F.
    pub const PARASITIC: f64 = 100e-12;
    /// In F.
    pub const BASE: f64 = 109.3e-15;
    /// In V/√Hz.
    pub const VOLTAGE_NOISE: f64 = 2.09e-9;
    /// In F/√Hz.
    pub const NOISE: f64 = 0.151e-18;
}

/// P Table I, for a bandwidth of 2 kHz.
pub mod table_i {
    /// In Hz.
    pub const BANDWIDTH_HZ: f64 = 2000.0;
    /// In nm.
    pub const AMPLITUDE_NM: f64 = 13.73;
    /// In rad.
    pub const PHASE: f64 = 1e-4;
    /// In nm.
    pub const OFFSET_NM: f64 = 4.034e-5;
    /// In Hz.
    pub const FREQUENCY_HZ: f64 = 11.62;
}

/// P section IV and Figures 6 to 9.
pub mod results {
    /// In Hz.
    pub const SAMPLING_HZ: f64 = 194e3;
    /// Relative, per minute.
    pub const DRIFT: f64 = 0.2;
    /// In nm, at that drift.
    pub const ERROR_NM: f64 = 20.0;
    /// In nm: what the filter claims of the amplitude.
    pub const CLAIM_NM: f64 = 2.0;
    /// Relative, per minute, and in nm.
    pub const LARGEST: [f64; 2] = [0.27, 60.0];
    /// In Hz, and in nm: an upper limit.
    pub const FASTEST: [f64; 2] = [1.4e6, 200.0];
    /// In nm: what the spectrometer asks for.
    pub const WANTED_NM: f64 = 50.0;
}
