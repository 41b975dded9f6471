//! What the process takes, under the names that Prometheus's own clients use.

use prometheus_client::{
    collector::Collector,
    encoding::{DescriptorEncoder, EncodeMetric},
    metrics::{counter::ConstCounter, gauge::ConstGauge},
    registry::Unit,
};

/// Memory, processor time and open files, read when they are asked for. Nothing where the system
/// has no `/proc`.
#[derive(Debug, Default)]
pub(super) struct Process;

/// Bytes of memory and seconds of processor time.
#[cfg(target_os = "linux")]
fn usage() -> Option<(u64, f64, u64)> {
    let statm = std::fs::read_to_string("/proc/self/statm").ok()?;
    let pages: u64 = statm.split(' ').nth(1)?.parse().ok()?;
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The command's name may hold blanks and brackets; what follows the last bracket does not.
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace().skip(11);
    let ticks: f64 = fields.next()?.parse().ok()?;
    let system_ticks: f64 = fields.next()?.parse().ok()?;
    let files = std::fs::read_dir("/proc/self/fd").ok()?.count() as u64;
    let seconds = (ticks + system_ticks) / rustix::param::clock_ticks_per_second() as f64;
    Some((pages * rustix::param::page_size() as u64, seconds, files))
}

#[cfg(not(target_os = "linux"))]
fn usage() -> Option<(u64, f64, u64)> {
    None
}

impl Collector for Process {
    fn encode(&self, mut encoder: DescriptorEncoder) -> Result<(), std::fmt::Error> {
        let Some((memory_bytes, cpu_seconds, open_files)) = usage() else { return Ok(()) };
        let memory = ConstGauge::new(memory_bytes as i64);
        memory.encode(encoder.encode_descriptor(
            "process_resident_memory",
            "Memory of the process that is not swapped out",
            Some(&Unit::Bytes),
            memory.metric_type(),
        )?)?;
        let cpu = ConstCounter::new(cpu_seconds);
        cpu.encode(encoder.encode_descriptor(
            "process_cpu",
            "Processor time of the process",
            Some(&Unit::Seconds),
            cpu.metric_type(),
        )?)?;
        let files = ConstGauge::new(open_files as i64);
        files.encode(encoder.encode_descriptor(
            "process_open_fds",
            "Open files and connections",
            None,
            files.metric_type(),
        )?)
    }
}
