//! The configuration file: every setting has its default, so that what is printed is a whole one.

use std::{
    collections::BTreeMap,
    net::{IpAddr, SocketAddr, ToSocketAddrs},
    path::{Path, PathBuf},
    time::Duration,
};

use anyhow::{Context, bail, ensure};
use clap::ValueEnum;
use serde::{Deserialize, Serialize};

use super::super::parse_size;
use crate::{
    access::{Access, AccessRules, DatasetPattern, MIN_KEY_BYTES, Secret, TokenHash, TokenRule},
    config::{DataPlace, RateLimit, ServeConfig, TlsFiles},
};

/// A configuration file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// A folder, or the address of an object store.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub data: Option<String>,
    /// Address and port.
    pub listen: String,
    /// Everyone may read everything.
    pub public: bool,
    /// Proxies in front.
    pub trusted_proxies: Vec<IpAddr>,
    /// Log lines.
    pub log: LogSettings,
    /// Limits.
    pub limits: LimitSettings,
    /// What is kept of an object store.
    pub cache: CacheSettings,
    /// Certificate and key.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tls: Option<TlsSettings>,
    /// How to reach an object store, in the words of the `object_store` crate.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub storage: BTreeMap<String, String>,
    /// Who may read what.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub access: Option<AccessSettings>,
}

/// How log lines are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum LogFormat {
    /// For people.
    #[default]
    Human,
    /// An object a line.
    Json,
}

/// The log.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LogSettings {
    /// How lines are written.
    pub format: LogFormat,
    /// Whether every request has one.
    pub requests: bool,
}

/// Limits on clients.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LimitSettings {
    pub max_connections: usize,
    pub max_body: String,
    pub requests_per_second: f64,
    pub burst: u32,
    pub head_timeout_secs: u64,
    pub write_timeout_secs: u64,
    pub response_timeout_secs: u64,
    pub drain_delay_secs: u64,
    pub drain_timeout_secs: u64,
}

/// What is kept of an object store.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CacheSettings {
    /// Most memory for it.
    pub memory: String,
}

/// Certificate and key.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TlsSettings {
    pub cert: PathBuf,
    pub key: PathBuf,
}

/// Who may read what.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AccessSettings {
    /// Names and beginnings (`site-*`) of datasets that everyone may read.
    pub public: Vec<String>,
    /// Files with the keys that addresses are signed with; the first one signs.
    pub signing_keys: Vec<PathBuf>,
    /// Tokens.
    pub tokens: Vec<TokenSettings>,
}

/// A bearer token, by its hash or in a file.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TokenSettings {
    /// What the log calls it.
    pub name: String,
    /// The token's SHA-256, in hexadecimal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sha256: Option<String>,
    /// The file that the token is in.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// Names and beginnings of datasets that it opens.
    pub datasets: Vec<String>,
    /// Whether it opens the figures.
    pub metrics: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            data: None,
            listen: "127.0.0.1:8080".into(),
            public: false,
            trusted_proxies: Vec::new(),
            log: LogSettings::default(),
            limits: LimitSettings::default(),
            cache: CacheSettings::default(),
            tls: None,
            storage: BTreeMap::new(),
            access: None,
        }
    }
}

impl Default for LimitSettings {
    fn default() -> Self {
        Self {
            max_connections: 8192,
            max_body: "1MiB".into(),
            requests_per_second: 0.0,
            burst: 200,
            head_timeout_secs: 60,
            write_timeout_secs: 60,
            response_timeout_secs: 30,
            drain_delay_secs: 0,
            drain_timeout_secs: 10,
        }
    }
}

impl Default for CacheSettings {
    fn default() -> Self {
        Self { memory: "256MiB".into() }
    }
}

/// Settings of an object store that are no secrets; all others are masked when printed.
const PLAIN_STORAGE: [&str; 11] = [
    "endpoint",
    "region",
    "default_region",
    "bucket",
    "bucket_name",
    "allow_http",
    "virtual_hosted_style_request",
    "skip_signature",
    "account_name",
    "container_name",
    "use_emulator",
];

impl Settings {
    /// Reads a configuration file.
    pub(super) fn read(path: &Path) -> anyhow::Result<Self> {
        let text = std::fs::read_to_string(path)
            .with_context(|| format!("{}: cannot read", path.display()))?;
        // TOML's messages point at the place with a picture of several lines; ours has one.
        toml::from_str(&text).map_err(|e: toml::de::Error| {
            let line = e.span().map_or(1, |span| 1 + text[..span.start].matches('\n').count());
            anyhow::anyhow!("{}: line {line}: {}", path.display(), e.message())
        })
    }

    /// The settings as a configuration file, without secrets.
    pub(super) fn print(&self) -> anyhow::Result<String> {
        let mut shown = self.clone();
        for (name, value) in &mut shown.storage {
            let plain = name.split_once('_').map_or(name.as_str(), |(_, rest)| rest);
            if !PLAIN_STORAGE.contains(&name.as_str()) && !PLAIN_STORAGE.contains(&plain) {
                *value = "***".into();
            }
        }
        toml::to_string(&shown).context("cannot write the configuration")
    }

    /// What the server is to be told; reads the files that hold secrets.
    pub(super) fn resolve(&self) -> anyhow::Result<ServeConfig> {
        let data = self.data.as_deref().context("data: say which folder or address to serve")?;
        let limits = &self.limits;
        let rate = limits.requests_per_second;
        ensure!(rate.is_finite() && rate >= 0.0, "requests_per_second: not a number from 0 on");
        ensure!(limits.max_connections > 0, "max_connections: 0 connections serve nobody");
        let max_body = size("limits.max_body", &limits.max_body)?;
        Ok(ServeConfig {
            data: DataPlace::new(data, self.storage.clone().into_iter().collect()),
            cache_bytes: size("cache.memory", &self.cache.memory)?,
            listen: resolve_address(&self.listen)?,
            access: self.access.as_ref().map_or(Ok(Access::Open), AccessSettings::resolve)?,
            is_public: self.public,
            tls: self.tls.clone().map(|tls| TlsFiles { cert: tls.cert, key: tls.key }),
            trusted_proxies: self.trusted_proxies.iter().map(IpAddr::to_canonical).collect(),
            access_log: self.log.requests,
            max_connections: limits.max_connections,
            max_body_bytes: usize::try_from(max_body).unwrap_or(usize::MAX),
            rate: (rate > 0.0).then_some(RateLimit { per_second: rate, burst: limits.burst }),
            head_timeout: Duration::from_secs(limits.head_timeout_secs),
            write_timeout: Duration::from_secs(limits.write_timeout_secs),
            response_timeout: Duration::from_secs(limits.response_timeout_secs),
            drain_delay: Duration::from_secs(limits.drain_delay_secs),
            drain_timeout: Duration::from_secs(limits.drain_timeout_secs),
        })
    }
}

fn size(name: &str, text: &str) -> anyhow::Result<u64> {
    parse_size(text).map_err(|e| anyhow::anyhow!("{name}: {e}"))
}

fn resolve_address(text: &str) -> anyhow::Result<SocketAddr> {
    let addresses = text.to_socket_addrs();
    let mut addresses = addresses.with_context(|| format!("{text}: write ADDRESS:PORT"))?;
    addresses.next().with_context(|| format!("{text}: the name has no address"))
}

impl AccessSettings {
    fn resolve(&self) -> anyhow::Result<Access> {
        let tokens =
            self.tokens.iter().map(TokenSettings::resolve).collect::<Result<Vec<_>, _>>()?;
        for (i, token) in tokens.iter().enumerate() {
            let twice = tokens[..i].iter().any(|other| other.name == token.name);
            ensure!(!twice, "access.tokens: two are called {:?}", token.name);
        }
        Ok(Access::Rules(AccessRules {
            public: patterns("access.public", &self.public)?,
            tokens,
            signing_keys: self
                .signing_keys
                .iter()
                .map(|f| read_key(f))
                .collect::<Result<_, _>>()?,
        }))
    }
}

impl TokenSettings {
    fn resolve(&self) -> anyhow::Result<TokenRule> {
        let place = format!("access.tokens: {:?}", self.name);
        ensure!(!self.name.is_empty(), "access.tokens: one has no name");
        ensure!(!self.datasets.is_empty() || self.metrics, "{place}: it opens no datasets");
        let hash = match (&self.sha256, &self.file) {
            (Some(hex), None) => TokenHash::parse(hex),
            (None, Some(file)) => std::fs::read_to_string(file)
                .map_err(|e| format!("{}: cannot read: {e}", file.display()))
                .and_then(|token| TokenHash::of_new(&token)),
            _ => bail!("{place}: give its sha256, or the file that it is in"),
        };
        Ok(TokenRule {
            name: self.name.clone(),
            hash: hash.map_err(|e| anyhow::anyhow!("{place}: {e}"))?,
            datasets: patterns(&place, &self.datasets)?,
            metrics: self.metrics,
        })
    }
}

fn patterns(place: &str, texts: &[String]) -> anyhow::Result<Vec<DatasetPattern>> {
    let parse = |text: &String| text.parse().map_err(|e| anyhow::anyhow!("{place}: {e}"));
    texts.iter().map(parse).collect()
}

/// Reads a signing key: all of a file, less white space at its ends.
pub(crate) fn read_key(path: &Path) -> anyhow::Result<Secret> {
    let place = path.display();
    let bytes = std::fs::read(path).with_context(|| format!("{place}: cannot read"))?;
    let key = bytes.trim_ascii();
    ensure!(
        key.len() >= MIN_KEY_BYTES,
        "{place}: a signing key has at least {MIN_KEY_BYTES} bytes; `lodestream-server token` makes one"
    );
    Ok(Secret::new(key.to_vec()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_printed_is_a_configuration_file_of_the_same_settings() {
        let mut settings = Settings { data: Some("/srv".into()), ..Settings::default() };
        settings.access = Some(AccessSettings {
            public: vec!["a".into()],
            tokens: vec![TokenSettings {
                name: "t".into(),
                sha256: Some("00".repeat(32)),
                datasets: vec!["*".into()],
                ..TokenSettings::default()
            }],
            ..AccessSettings::default()
        });
        let printed = settings.print().expect("TOML");
        assert_eq!(toml::from_str::<Settings>(&printed).expect("TOML"), settings);
    }

    #[test]
    fn the_defaults_are_the_same_wherever_they_stand() {
        let settings = Settings { data: Some("/srv".into()), ..Settings::default() };
        let mut config = settings.resolve().expect("sound");
        // A program has a log, a part of one need not.
        config.access_log = false;
        assert_eq!(config, ServeConfig::new("/srv", SocketAddr::from(([127, 0, 0, 1], 8080))));
        let deployed = Path::new(env!("CARGO_MANIFEST_DIR")).join("../deploy/lodestream.toml");
        let deployed = Settings::read(&deployed).expect("sound");
        assert_eq!((deployed.limits, deployed.cache), (settings.limits, settings.cache));
    }

    #[test]
    fn secrets_are_not_printed() {
        let mut settings = Settings::default();
        for (name, value) in [("aws_secret_access_key", "hush"), ("sas", "hush"), ("region", "eu")]
        {
            settings.storage.insert(name.into(), value.into());
        }
        let printed = settings.print().expect("TOML");
        assert!(!printed.contains("hush") && printed.contains("region = \"eu\""), "{printed}");
    }

    #[test]
    fn misspelt_settings_are_refused_with_their_line() {
        let file = tempfile::NamedTempFile::new().expect("a temporary file");
        std::fs::write(file.path(), "data = \"x\"\n\n[limits]\nmax_conections = 1\n")
            .expect("ours");
        let error = Settings::read(file.path()).expect_err("misspelt").to_string();
        assert!(error.contains("line 4") && error.contains("max_conections"), "{error}");
    }

    #[test]
    fn settings_that_mean_nothing_are_refused() {
        let refused = |change: &dyn Fn(&mut Settings)| {
            let mut settings = Settings { data: Some("x".into()), ..Settings::default() };
            change(&mut settings);
            settings.resolve().expect_err("refused").to_string()
        };
        let token = |token: TokenSettings| {
            let access = AccessSettings { tokens: vec![token], ..AccessSettings::default() };
            refused(&|s| s.access = Some(access.clone()))
        };
        let named = TokenSettings { name: "t".into(), ..TokenSettings::default() };
        let all = TokenSettings { datasets: vec!["*".into()], ..named.clone() };
        assert!(refused(&|s| s.data = None).contains("folder"));
        assert!(refused(&|s| s.listen = "8080".into()).contains("ADDRESS:PORT"));
        assert!(refused(&|s| s.limits.requests_per_second = -1.0).contains("requests_per_second"));
        assert!(refused(&|s| s.limits.max_connections = 0).contains("max_connections"));
        assert!(refused(&|s| s.cache.memory = "much".into()).contains("cache.memory"));
        assert!(token(named).contains("opens no datasets"));
        assert!(token(all.clone()).contains("sha256"));
        let hex = Some("00".into());
        assert!(token(TokenSettings { sha256: hex, ..all.clone() }).contains("64 hexadecimal"));
        let file = Some("no/such/file".into());
        assert!(token(TokenSettings { file, ..all }).contains("no/such/file"));
    }
}
