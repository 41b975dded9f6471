//! Whether a file lies on a disk of this machine.

use std::{fs::File, path::Path};

/// File systems of disks and memory, as `statfs(2)` numbers them: ext2 to ext4, XFS, Btrfs, F2FS, ZFS, bcachefs,
/// overlayfs, tmpfs, EROFS, SquashFS. Those of a network have numbers too, but new ones come, and what a program
/// answers for (FUSE) may be anywhere: what is not listed counts as elsewhere.
#[cfg(target_os = "linux")]
const LOCAL: [u64; 10] = [
    0xEF53,
    0x5846_5342,
    0x9123_683E,
    0xF2F5_2010,
    0x2FC1_2FC1,
    0xCA45_1A4E,
    0x794C_7630,
    0x0102_1994,
    0xE0F5_E1E2,
    0x7371_7368,
];

/// Whether both file and folder do: a folder may hold links to other disks (blocking).
#[cfg(target_os = "linux")]
pub(crate) fn is_local(file: &File, folder: &Path) -> bool {
    use rustix::fs::{StatFs, fstatfs, statfs};
    // Of 32 or 64 bits, with or without a sign, by processor.
    let is_listed = |system: StatFs| LOCAL.contains(&(system.f_type as u64 & 0xFFFF_FFFF));
    fstatfs(file).is_ok_and(is_listed) && statfs(folder).is_ok_and(is_listed)
}

/// Nothing tells here.
#[cfg(not(target_os = "linux"))]
pub(crate) fn is_local(_: &File, _: &Path) -> bool {
    false
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn a_disk_is_local_and_what_the_system_makes_up_is_not() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("a");
        std::fs::write(&path, "").expect("writable");
        let open = |path: &Path| File::open(path).expect("it is there");
        let (here, made_up) = (open(&path), open("/proc/self/status".as_ref()));
        assert!(is_local(&here, folder.path()));
        assert!(!is_local(&made_up, folder.path()));
        assert!(!is_local(&here, "/proc".as_ref()));
    }
}
