//! Who is at the other end.

use std::net::IpAddr;

use axum::http::{HeaderMap, HeaderName};

const FORWARDED_FOR: HeaderName = HeaderName::from_static("x-forwarded-for");
const FORWARDED_PROTO: HeaderName = HeaderName::from_static("x-forwarded-proto");
const FORWARDED_HOST: HeaderName = HeaderName::from_static("x-forwarded-host");

/// The other end of a connection: a client, or a proxy.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Peer {
    pub(crate) ip: IpAddr,
    pub(crate) is_encrypted: bool,
}

impl Peer {
    /// The client's address: what the trusted proxies say, as far as they are trusted. Each proxy
    /// adds the address that it was asked from at the end of the list, so the last one that is not
    /// a trusted proxy's is the client's; what stands before it is hearsay.
    pub(crate) fn client(&self, headers: &HeaderMap, trusted: &[IpAddr]) -> IpAddr {
        let mut client = self.ip.to_canonical();
        let fields: Vec<_> = headers.get_all(FORWARDED_FOR).iter().collect();
        let listed = fields.iter().filter_map(|value| value.to_str().ok());
        let listed: Vec<_> = listed.flat_map(|value| value.split(',')).collect();
        for address in listed.iter().rev() {
            if !trusted.contains(&client) {
                break;
            }
            let Ok(address) = address.trim().parse::<IpAddr>() else { break };
            client = address.to_canonical();
        }
        client
    }

    /// Scheme and host that the client has written in its address line, as far as is known.
    pub(crate) fn origin(&self, headers: &HeaderMap, host: &str, trusted: &[IpAddr]) -> String {
        let is_proxy = trusted.contains(&self.ip.to_canonical());
        let told = |name: HeaderName| {
            headers.get(name).filter(|_| is_proxy).and_then(|value| value.to_str().ok())
        };
        let scheme = match told(FORWARDED_PROTO) {
            Some("https") => "https",
            Some(_) => "http",
            None if self.is_encrypted => "https",
            None => "http",
        };
        format!("{scheme}://{}", told(FORWARDED_HOST).unwrap_or(host))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    fn headers(fields: &[(HeaderName, &'static str)]) -> HeaderMap {
        fields.iter().map(|(n, v)| (n.clone(), HeaderValue::from_static(v))).collect()
    }

    fn ip(text: &str) -> IpAddr {
        text.parse().expect(text)
    }

    #[test]
    fn only_trusted_proxies_are_believed() {
        let peer = Peer { ip: ip("::ffff:10.0.0.1"), is_encrypted: false };
        let fields = headers(&[(FORWARDED_FOR, "6.6.6.6, 192.0.2.7, 10.0.0.2")]);
        let client = |trusted: &[IpAddr]| peer.client(&fields, trusted);
        assert_eq!(client(&[]), ip("10.0.0.1"));
        assert_eq!(client(&[ip("10.0.0.1")]), ip("10.0.0.2"));
        assert_eq!(client(&[ip("10.0.0.1"), ip("10.0.0.2")]), ip("192.0.2.7"));
        let garbage = headers(&[(FORWARDED_FOR, "192.0.2.7, unknown")]);
        assert_eq!(peer.client(&garbage, &[ip("10.0.0.1")]), ip("10.0.0.1"));
    }

    #[test]
    fn addresses_are_those_that_the_client_sees() {
        let peer = Peer { ip: ip("10.0.0.1"), is_encrypted: false };
        let fields = headers(&[(FORWARDED_PROTO, "https"), (FORWARDED_HOST, "a.example")]);
        assert_eq!(peer.origin(&fields, "b:80", &[]), "http://b:80");
        assert_eq!(peer.origin(&fields, "b:80", &[peer.ip]), "https://a.example");
        let direct = Peer { is_encrypted: true, ..peer };
        assert_eq!(direct.origin(&HeaderMap::new(), "b", &[]), "https://b");
    }
}
