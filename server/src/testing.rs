//! Datasets by hand, for tests.

use lodestream_protocol::Header;

/// The header of a file of so many bytes, whose index is not sound: that is for readers to see.
pub fn header(file_bytes: u64) -> Header {
    Header {
        version: (1, 0),
        manifest_bytes: 0,
        root_page_bytes: 0,
        boot_bytes: 64,
        file_bytes,
        content_id: [7; 16],
        index_crc: 0,
    }
}
