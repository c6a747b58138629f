//! Encryption of a connection, and whom it trusts.

use std::net::TcpStream;
use std::path::Path;
use std::sync::Arc;

use lynkeus::study::MqttSettings;
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer, ServerName};
use rustls::{ClientConfig, ClientConnection, RootCertStore, StreamOwned};

/// A connection that nobody reads or changes on the way.
pub(super) type Stream = StreamOwned<ClientConnection, TcpStream>;

/// A connection to a host whose certificate is one of `ca`, or of those that the system trusts.
///
/// # Errors
/// A file cannot be read, or the host is another one.
pub(super) fn stream(
    settings: &MqttSettings,
    host: &str,
    mut socket: TcpStream,
) -> Result<Stream, String> {
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = ClientConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .map_err(|error| error.to_string())?
        .with_root_certificates(roots(settings.ca.as_deref())?);
    let config = match (&settings.cert, &settings.key) {
        (Some(cert), Some(key)) => {
            let own = config.with_client_auth_cert(certificates(cert)?, private(key)?);
            own.map_err(|error| format!("{}: {error}", cert.display()))?
        }
        _ => config.with_no_client_auth(),
    };
    let name = ServerName::try_from(host.to_owned()).map_err(|error| error.to_string())?;
    let mut connection =
        ClientConnection::new(Arc::new(config), name).map_err(|error| error.to_string())?;
    while connection.is_handshaking() {
        connection
            .complete_io(&mut socket)
            .map_err(|error| error.to_string())?;
    }
    Ok(StreamOwned::new(connection, socket))
}

fn roots(ca: Option<&Path>) -> Result<RootCertStore, String> {
    let mut roots = RootCertStore::empty();
    let found = match ca {
        Some(path) => certificates(path)?,
        None => rustls_native_certs::load_native_certs().certs,
    };
    // a system has some that nobody reads
    let (taken, _) = roots.add_parsable_certificates(found);
    match (taken, ca) {
        (0, Some(path)) => Err(format!("{}: no certificate in it", path.display())),
        (0, None) => Err(
            "the system has no trusted certificates: name a file of certificates as `ca`"
                .to_owned(),
        ),
        _ => Ok(roots),
    }
}

fn certificates(path: &Path) -> Result<Vec<CertificateDer<'static>>, String> {
    let failed = |error: rustls::pki_types::pem::Error| format!("{}: {error}", path.display());
    let found = CertificateDer::pem_file_iter(path).map_err(failed)?;
    found.collect::<Result<_, _>>().map_err(failed)
}

fn private(path: &Path) -> Result<PrivateKeyDer<'static>, String> {
    PrivateKeyDer::from_pem_file(path).map_err(|error| format!("{}: {error}", path.display()))
}
