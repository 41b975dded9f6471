//! What the command line and the environment say.

use std::path::PathBuf;

use clap::Args;

use super::settings::{LogFormat, Settings, TlsSettings, TokenSettings};

/// Host datasets over HTTP
///
/// A flag counts before its environment variable, that before the configuration file, that before
/// the default. --print-config shows what came of it, as a configuration file.
#[derive(Debug, Clone, Args)]
pub struct ServeArgs {
    /// Folder of NAME.lods files, or where an object store has them: s3://BUCKET/PREFIX, gs://…,
    /// az://…, https://…; new ones appear without a restart
    #[arg(env = "LODESTREAM_DATA", value_name = "DIR|URL", required_unless_present = "config")]
    pub data: Option<String>,
    /// Configuration file (TOML); docs/OPERATING.md has one with every setting
    #[arg(long, value_name = "FILE.toml", env = "LODESTREAM_CONFIG")]
    pub config: Option<PathBuf>,
    /// Print the configuration that would be used, without secrets, and end
    #[arg(long)]
    pub print_config: bool,
    /// Address and port to listen on; port 0 takes a free one [default: 127.0.0.1:8080]
    #[arg(long, value_name = "ADDR:PORT", env = "LODESTREAM_LISTEN", value_parser = address)]
    pub listen: Option<String>,
    /// Let everyone read everything, on an address that other machines reach
    #[arg(long, env = "LODESTREAM_PUBLIC")]
    pub public: bool,
    /// File with a token that opens all datasets and the figures; nothing is read without it
    #[arg(long, value_name = "FILE", env = "LODESTREAM_TOKEN_FILE")]
    pub token_file: Option<PathBuf>,
    /// Certificate chain in PEM; with it, connections are encrypted
    #[arg(long, value_name = "FILE.pem", env = "LODESTREAM_TLS_CERT", requires = "tls_key")]
    pub tls_cert: Option<PathBuf>,
    /// The certificate's private key in PEM
    #[arg(long, value_name = "FILE.pem", env = "LODESTREAM_TLS_KEY", requires = "tls_cert")]
    pub tls_key: Option<PathBuf>,
    /// Address of a proxy in front, whose X-Forwarded-… fields are believed
    #[arg(long, value_name = "IP", env = "LODESTREAM_TRUSTED_PROXIES", value_delimiter = ',')]
    pub trusted_proxy: Vec<std::net::IpAddr>,
    /// Most connections at a time [default: 8192]
    #[arg(long, value_name = "N", env = "LODESTREAM_MAX_CONNECTIONS")]
    pub max_connections: Option<usize>,
    /// Requests a second that one client may make in the long run; 0: any number [default: 0]
    #[arg(long, value_name = "N", env = "LODESTREAM_REQUESTS_PER_SECOND")]
    pub requests_per_second: Option<f64>,
    /// Requests that one client may make at once after a pause [default: 200]
    #[arg(long, value_name = "N", env = "LODESTREAM_BURST")]
    pub burst: Option<u32>,
    /// Seconds for a request's head, and for an idle connection [default: 60]
    #[arg(long, value_name = "SECS", env = "LODESTREAM_HEAD_TIMEOUT_SECS")]
    pub head_timeout_secs: Option<u64>,
    /// Seconds that a client may leave bytes untaken [default: 60]
    #[arg(long, value_name = "SECS", env = "LODESTREAM_WRITE_TIMEOUT_SECS")]
    pub write_timeout_secs: Option<u64>,
    /// Seconds until a response begins [default: 30]
    #[arg(long, value_name = "SECS", env = "LODESTREAM_RESPONSE_TIMEOUT_SECS")]
    pub response_timeout_secs: Option<u64>,
    /// Seconds to go on, telling `/readyz` no, once asked to stop [default: 0]
    #[arg(long, value_name = "SECS", env = "LODESTREAM_DRAIN_DELAY_SECS")]
    pub drain_delay_secs: Option<u64>,
    /// Seconds for responses under way after that [default: 10]
    #[arg(long, value_name = "SECS", env = "LODESTREAM_DRAIN_TIMEOUT_SECS")]
    pub drain_timeout_secs: Option<u64>,
    /// Memory for what was read from an object store [default: 256MiB]
    #[arg(long, value_name = "SIZE", env = "LODESTREAM_CACHE")]
    pub cache: Option<String>,
    /// How log lines are written [default: human]
    #[arg(long, value_enum, env = "LODESTREAM_LOG_FORMAT")]
    pub log_format: Option<LogFormat>,
    /// Log every request
    #[arg(short, long, env = "LODESTREAM_LOG_REQUESTS")]
    pub verbose: bool,
}

impl ServeArgs {
    /// Puts what was given in place of what the file says.
    pub(super) fn overlay(&self, settings: &mut Settings) {
        fn set<T: Clone>(setting: &mut T, given: &Option<T>) {
            if let Some(given) = given {
                setting.clone_from(given);
            }
        }
        let limits = &mut settings.limits;
        set(&mut limits.max_connections, &self.max_connections);
        set(&mut limits.requests_per_second, &self.requests_per_second);
        set(&mut limits.burst, &self.burst);
        set(&mut limits.head_timeout_secs, &self.head_timeout_secs);
        set(&mut limits.write_timeout_secs, &self.write_timeout_secs);
        set(&mut limits.response_timeout_secs, &self.response_timeout_secs);
        set(&mut limits.drain_delay_secs, &self.drain_delay_secs);
        set(&mut limits.drain_timeout_secs, &self.drain_timeout_secs);
        set(&mut settings.listen, &self.listen);
        set(&mut settings.cache.memory, &self.cache);
        set(&mut settings.log.format, &self.log_format);
        settings.log.requests |= self.verbose;
        settings.public |= self.public;
        if self.data.is_some() {
            settings.data.clone_from(&self.data);
        }
        if !self.trusted_proxy.is_empty() {
            settings.trusted_proxies.clone_from(&self.trusted_proxy);
        }
        if let (Some(cert), Some(key)) = (&self.tls_cert, &self.tls_key) {
            settings.tls = Some(TlsSettings { cert: cert.clone(), key: key.clone() });
        }
        if let Some(file) = &self.token_file {
            settings.access.get_or_insert_default().tokens.push(TokenSettings {
                name: "token-file".into(),
                file: Some(file.clone()),
                datasets: vec!["*".into()],
                metrics: true,
                ..TokenSettings::default()
            });
        }
    }
}

/// Refuses at once what names no address.
fn address(text: &str) -> Result<String, String> {
    let addresses = std::net::ToSocketAddrs::to_socket_addrs(text);
    addresses.map(|_| text.to_owned()).map_err(|e| format!("{e}; write ADDRESS:PORT"))
}
