# The command in an image:  docker build -t lynkeus .
#   docker run --rm -v "$PWD:/work" lynkeus check study.toml
FROM rust:1.95-slim-bookworm AS build
# zstd, for Parquet, is C
RUN apt-get update && apt-get install --yes --no-install-recommends gcc libc6-dev && rm -rf /var/lib/apt/lists/*
WORKDIR /source
COPY . .
RUN cargo build --release --locked --package lynkeus-cli && strip target/release/lynkeus

FROM debian:bookworm-slim
COPY --from=build /source/target/release/lynkeus /usr/local/bin/lynkeus
COPY LICENSE-MIT LICENSE-APACHE /usr/share/doc/lynkeus/
WORKDIR /work
ENTRYPOINT ["lynkeus"]
CMD ["--help"]
