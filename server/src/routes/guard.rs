//! What stands before every route: how often, and with what right.

use std::{
    net::{IpAddr, Ipv4Addr},
    sync::Arc,
    time::{Instant, SystemTime},
};

use axum::{
    extract::{RawPathParams, Request, State},
    http::{HeaderValue, StatusCode, header},
    middleware::Next,
    response::{IntoResponse, Response},
};

use super::{Refusal, Site, missing};
use crate::{
    access::{Access, Rights},
    observe::{Holder, ServedDataset},
    peer::Peer,
    storage::dataset_name,
};

/// Finds out what a request may read, and leaves that in its extensions; refuses it where it is one
/// too many, or where its token or signature is not good.
pub(super) async fn admit(
    State(site): State<Arc<Site>>,
    mut request: Request,
    next: Next,
) -> Response {
    if let Some(rate) = &site.rate {
        let peer = request.extensions().get::<Peer>();
        let client = peer.map_or(IpAddr::V4(Ipv4Addr::UNSPECIFIED), |peer| {
            peer.client(request.headers(), &site.trusted_proxies)
        });
        if let Err(wait) = rate.take(client, Instant::now()) {
            site.metrics.rate_limited.inc();
            let seconds = wait.as_secs().saturating_add(1).min(3600);
            let line = format!("too many requests from {client}; again in {seconds} s");
            let refusal = Refusal::new(StatusCode::TOO_MANY_REQUESTS, line);
            return ([(header::RETRY_AFTER, seconds.to_string())], refusal).into_response();
        }
    }
    let access = site.access();
    let query = request.uri().query().unwrap_or_default();
    match Rights::of(&access, request.headers(), query, SystemTime::now()) {
        Ok(rights) => {
            let holder = rights.holder().map(|name| Holder(name.to_owned()));
            let (is_open, is_anonymous) = (matches!(*access, Access::Open), rights.is_anonymous());
            request.extensions_mut().insert(rights);
            let mut response = next.run(request).await;
            if let Some(holder) = holder {
                response.extensions_mut().insert(holder);
            }
            if !is_open {
                let headers = response.headers_mut();
                headers.append(header::VARY, HeaderValue::from_static("authorization"));
            }
            if !is_anonymous {
                keep_from_shared_caches(&mut response);
            }
            response
        }
        Err(refused) => {
            site.metrics.denied.inc();
            let mut response = Refusal::new(refused.status, refused.line).into_response();
            if refused.status == StatusCode::UNAUTHORIZED {
                let challenge = HeaderValue::from_static("Bearer error=\"invalid_token\"");
                response.headers_mut().insert(header::WWW_AUTHENTICATE, challenge);
            }
            response
        }
    }
}

/// Lets a request pass to a route with a `{file}` where it may read that dataset; answers as if
/// there were none otherwise. The name is the one that the route itself will see.
pub(super) async fn may_read(
    State(site): State<Arc<Site>>,
    params: RawPathParams,
    request: Request,
    next: Next,
) -> Response {
    let file = params.iter().find(|(name, _)| *name == "file").map(|(_, file)| file.to_owned());
    let (Some(file), Some(rights)) = (file, request.extensions().get::<Rights>()) else {
        return missing("").into_response();
    };
    if !rights.may_read(&file) {
        site.metrics.denied.inc();
        return missing(&file).into_response();
    }
    let mut response = next.run(request).await;
    let status = response.status();
    if status.is_success() || status == StatusCode::NOT_MODIFIED {
        let name = dataset_name(&file).unwrap_or_default().to_owned();
        response.extensions_mut().insert(ServedDataset(name));
    }
    response
}

/// An answer to somebody with a token or a link is for them: a cache between must not give it to others
/// (RFC 9111, section 5.2.2.7). The client's own may keep it as long as ever.
fn keep_from_shared_caches(response: &mut Response) {
    let headers = response.headers_mut();
    let told = headers.get(header::CACHE_CONTROL).and_then(|value| value.to_str().ok());
    let private = match told {
        Some(told) if told.contains("no-store") || told.contains("private") => return,
        Some(told) => {
            let rest = told.split(',').map(str::trim).filter(|part| *part != "public");
            ["private"].into_iter().chain(rest).collect::<Vec<_>>().join(", ")
        }
        None => "private".to_owned(),
    };
    if let Ok(value) = HeaderValue::from_str(&private) {
        headers.insert(header::CACHE_CONTROL, value);
    }
}
