//! What the system says of this process.

/// Resident memory in MiB; NaN where the system does not tell.
pub fn resident_mib() -> f64 {
    status("VmRSS:").map_or(f64::NAN, |kib| kib / 1024.0)
}

/// The most that was resident since the start, or since [`forget_peak`].
pub fn peak_mib() -> f64 {
    status("VmHWM:").map_or(f64::NAN, |kib| kib / 1024.0)
}

/// Begins a new peak.
pub fn forget_peak() {
    // Where that cannot be done, the peak is that since the start.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

/// Threads; NaN where the system does not tell.
pub fn threads() -> f64 {
    status("Threads:").unwrap_or(f64::NAN)
}

/// Open files and sockets.
pub fn descriptors() -> usize {
    std::fs::read_dir("/proc/self/fd").map_or(0, Iterator::count)
}

/// Seconds of processors' time.
pub fn cpu_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // After the name, which may hold spaces: the 14th and 15th field, in hundredths.
    let fields = stat.rsplit_once(')').map_or("", |(_, rest)| rest).split_whitespace().skip(11);
    fields.take(2).filter_map(|ticks| ticks.parse::<f64>().ok()).sum::<f64>() / 100.0
}

fn status(name: &str) -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with(name))?;
    line.split_whitespace().nth(1)?.parse().ok()
}
