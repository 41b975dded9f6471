//! What a report's figures hang on besides the program: the machine.

/// Processor, cores and system in a line, as far as the system tells.
#[must_use]
pub fn machine() -> String {
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let plural = if cores == 1 { "core" } else { "cores" };
    let processor = processor().unwrap_or_else(|| std::env::consts::ARCH.into());
    format!("{processor}, {cores} {plural}, {}", std::env::consts::OS)
}

/// The processor's name, where a file tells it.
fn processor() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let (_, name) = text.lines().find(|line| line.starts_with("model name"))?.split_once(':')?;
    Some(name.trim().to_owned()).filter(|name| !name.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_machine_is_told_in_one_line() {
        let told = machine();
        assert!(told.contains("core") && !told.contains('\n'), "{told}");
    }
}
