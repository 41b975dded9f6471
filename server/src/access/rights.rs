//! What one request may read.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use axum::http::{HeaderMap, StatusCode, header};
use httpdate::HttpDate;
use subtle::{Choice, ConditionallySelectable};

use super::{Access, AccessRules, DatasetPattern, TokenHash, signature, signature::Flaw};
use crate::storage::dataset_name;

/// What one request may read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Rights {
    /// `None`: everything.
    datasets: Option<Vec<DatasetPattern>>,
    metrics: bool,
    /// The query of a signed address, for the addresses that are handed out.
    link: Option<String>,
    /// The name of the token that was sent, for the log.
    holder: Option<String>,
}

/// Why a request is refused whatever it asks for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Refused {
    pub(crate) status: StatusCode,
    pub(crate) line: String,
}

impl Rights {
    /// What a request with these fields and this query may read.
    ///
    /// A token or signature that is not known is refused at once, whatever the request asks for: a
    /// client with a mistyped token hears of it, and learns nothing of any dataset.
    pub(crate) fn of(
        access: &Access,
        headers: &HeaderMap,
        query: &str,
        now: SystemTime,
    ) -> Result<Self, Refused> {
        let Access::Rules(rules) = access else {
            return Ok(Self { datasets: None, metrics: true, link: None, holder: None });
        };
        let datasets = Some(rules.public.clone());
        let mut rights = Self { datasets, metrics: false, link: None, holder: None };
        if let Some(token) = bearer(headers)? {
            rights.add_token(rules, token)?;
        }
        match signature::verify(query, &rules.signing_keys, now) {
            Ok(None) => {}
            Ok(Some(link)) => {
                rights.link = Some(signature::only_link(query));
                rights.datasets.get_or_insert_default().push(link.datasets);
            }
            Err(Flaw::Expired { since }) => {
                let date = HttpDate::from(UNIX_EPOCH + Duration::from_secs(since));
                let line = format!("this link expired on {date}; ask for a new one");
                return Err(Refused { status: StatusCode::FORBIDDEN, line });
            }
            Err(Flaw::Forged) => {
                let line = "the link's signature is not valid: it was altered or cut short on its \
                            way, or its key is no longer in use";
                return Err(Refused { status: StatusCode::FORBIDDEN, line: line.into() });
            }
        }
        Ok(rights)
    }

    fn add_token(&mut self, rules: &AccessRules, token: &str) -> Result<(), Refused> {
        let hash = TokenHash::of(token);
        // Every rule is looked at, so that time does not tell which one it was.
        let mut place = u32::MAX;
        for (i, rule) in (0..).zip(&rules.tokens) {
            let is_this: Choice = rule.hash.is(&hash);
            place.conditional_assign(&i, is_this);
        }
        let Some(rule) = rules.tokens.get(place as usize) else {
            return Err(unauthorized("the bearer token is not known here"));
        };
        self.datasets.get_or_insert_default().extend(rule.datasets.iter().cloned());
        self.metrics = rule.metrics;
        self.holder = Some(rule.name.clone());
        Ok(())
    }

    /// Whether a dataset's file may be read, or its name be known.
    pub(crate) fn may_read(&self, file_name: &str) -> bool {
        let Some(patterns) = &self.datasets else { return true };
        let name = dataset_name(file_name);
        name.is_some_and(|name| patterns.iter().any(|pattern| pattern.covers(name)))
    }

    /// Whether the server's figures, which name datasets, may be read.
    pub(crate) const fn may_read_metrics(&self) -> bool {
        self.metrics
    }

    /// An address with whatever the rights came by, as far as that may stand in an address.
    pub(crate) fn address(&self, url: &str) -> String {
        let sign = if url.contains('?') { '&' } else { '?' };
        self.link.as_ref().map_or_else(|| url.to_owned(), |link| format!("{url}{sign}{link}"))
    }

    /// Whether they are everyone's.
    pub(crate) const fn is_anonymous(&self) -> bool {
        self.link.is_none() && self.holder.is_none()
    }

    /// The name of the token that was sent.
    pub(crate) fn holder(&self) -> Option<&str> {
        self.holder.as_deref()
    }
}

/// The bearer token (RFC 6750, section 2.1). Other schemes are somebody else's: a proxy's, say.
fn bearer(headers: &HeaderMap) -> Result<Option<&str>, Refused> {
    let mut tokens = headers.get_all(header::AUTHORIZATION).iter().filter_map(|value| {
        let (scheme, token) = value.as_bytes().split_at_checked(7)?;
        scheme.eq_ignore_ascii_case(b"bearer ").then_some(token)
    });
    let Some(token) = tokens.next() else { return Ok(None) };
    let token = std::str::from_utf8(token).map(str::trim);
    match (token, tokens.next()) {
        (Ok(token), None) if !token.is_empty() => Ok(Some(token)),
        _ => Err(unauthorized("the Authorization field holds no single bearer token")),
    }
}

fn unauthorized(line: &str) -> Refused {
    Refused { status: StatusCode::UNAUTHORIZED, line: line.into() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::access::TokenRule;
    use axum::http::HeaderValue;

    const TOKEN: &str = "a-token-of-more-than-22-bytes";

    fn rules() -> Access {
        Access::Rules(AccessRules {
            public: vec!["open".parse().expect("a name")],
            tokens: vec![TokenRule {
                name: "team".into(),
                hash: TokenHash::of(TOKEN),
                datasets: vec!["site-*".parse().expect("a prefix")],
                metrics: true,
            }],
            signing_keys: vec![],
        })
    }

    fn rights(field: Option<&str>) -> Result<Rights, StatusCode> {
        let fields =
            field.map(|f| (header::AUTHORIZATION, HeaderValue::from_str(f).expect("text")));
        let headers = fields.into_iter().collect();
        Rights::of(&rules(), &headers, "", SystemTime::now()).map_err(|refused| refused.status)
    }

    #[test]
    fn a_token_adds_to_what_is_public() {
        let none = rights(None).expect("no token is no error");
        assert!(none.may_read("open.lods") && !none.may_read("site-1.lods"));
        assert!(!none.may_read_metrics());
        let with = rights(Some(&format!("bearer {TOKEN}"))).expect("known");
        assert!(with.may_read("open.lods") && with.may_read("site-1.lods"));
        assert!(!with.may_read("other.lods") && !with.may_read("site-1") && !with.may_read(""));
        assert!(with.may_read_metrics());
        assert_eq!(with.holder(), Some("team"));
    }

    #[test]
    fn unknown_tokens_are_refused_and_other_schemes_ignored() {
        for field in ["Bearer x", "Bearer ", "bearer  ", &format!("Bearer {TOKEN}x")] {
            assert_eq!(rights(Some(field)), Err(StatusCode::UNAUTHORIZED), "{field}");
        }
        for field in ["Basic eDp5", "", TOKEN, &format!("Token {TOKEN}")] {
            assert_eq!(rights(Some(field)), rights(None), "{field}");
        }
    }

    #[test]
    fn everything_is_everyones_without_rules() {
        let open = Rights::of(&Access::Open, &HeaderMap::new(), "", SystemTime::now());
        let open = open.expect("no rules, no refusal");
        assert!(open.may_read("any.lods") && open.may_read_metrics());
    }
}
