//! TLS by rustls: versions 1.2 and 1.3, HTTP/2 and HTTP/1.1 by ALPN.

use std::{
    fs::Metadata,
    path::Path,
    sync::{Arc, PoisonError, RwLock},
    time::SystemTime,
};

use rustls::{
    ServerConfig,
    crypto::ring,
    pki_types::{CertificateDer, PrivateKeyDer, pem::PemObject},
};
use tokio_rustls::TlsAcceptor;

use crate::{
    config::TlsFiles,
    error::{Error, Result},
};

/// What both sides may speak, the server's choice first.
const ALPN: [&[u8]; 2] = [b"h2", b"http/1.1"];

/// Certificate and key, which can be read again while the server runs.
pub(crate) struct Tls {
    files: TlsFiles,
    current: RwLock<(Arc<ServerConfig>, Stamp)>,
}

/// Tells whether the files are still those that were read.
type Stamp = [Option<(u64, SystemTime)>; 2];

impl Tls {
    pub(crate) fn open(files: TlsFiles) -> Result<Self> {
        // Before the files: what changes in between is read again.
        let stamp = stamp(&files);
        let config = load(&files)?;
        Ok(Self { files, current: RwLock::new((config, stamp)) })
    }

    /// For the next connection.
    pub(crate) fn acceptor(&self) -> TlsAcceptor {
        let current = self.current.read().unwrap_or_else(PoisonError::into_inner);
        TlsAcceptor::from(Arc::clone(&current.0))
    }

    /// Reads both files again; connections that stand keep what they began with. Where the files
    /// are not good, the old ones stay in use.
    pub(crate) fn reload(&self) -> Result<()> {
        let stamp = stamp(&self.files);
        let loaded = load(&self.files);
        let mut current = self.current.write().unwrap_or_else(PoisonError::into_inner);
        // Noted either way: a bad file is told of once.
        current.1 = stamp;
        current.0 = loaded?;
        Ok(())
    }

    /// Whether the files are other ones than were read last.
    pub(crate) fn has_changed(&self) -> bool {
        let known = self.current.read().unwrap_or_else(PoisonError::into_inner).1;
        stamp(&self.files) != known
    }
}

impl std::fmt::Debug for Tls {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Tls").field("files", &self.files).finish_non_exhaustive()
    }
}

fn stamp(files: &TlsFiles) -> Stamp {
    let of = |metadata: Metadata| Some((metadata.len(), metadata.modified().ok()?));
    [&files.cert, &files.key].map(|path| std::fs::metadata(path).ok().and_then(of))
}

fn load(files: &TlsFiles) -> Result<Arc<ServerConfig>> {
    let failed = |path: &Path, reason: String| Error::Tls { path: path.to_owned(), reason };
    let unreadable = |path: &Path, what: &str, e: rustls::pki_types::pem::Error| {
        failed(path, format!("no {what} in PEM can be read: {e}"))
    };
    let certificates: Vec<_> = CertificateDer::pem_file_iter(&files.cert)
        .and_then(Iterator::collect)
        .map_err(|e| unreadable(&files.cert, "certificate", e))?;
    if certificates.is_empty() {
        return Err(failed(&files.cert, "there is no certificate in it".into()));
    }
    let key = PrivateKeyDer::from_pem_file(&files.key)
        .map_err(|e| unreadable(&files.key, "private key", e))?;
    let mut config = ServerConfig::builder_with_provider(Arc::new(ring::default_provider()))
        .with_safe_default_protocol_versions()
        .map(|builder| builder.with_no_client_auth())
        .and_then(|builder| builder.with_single_cert(certificates, key))
        .map_err(|e| failed(&files.cert, format!("cannot be used with the key: {e}")))?;
    config.alpn_protocols = ALPN.map(<[u8]>::to_vec).into();
    Ok(Arc::new(config))
}
