# damageest in a container, as a user without rights. Targets: core (the default route and its page) and all (every plugin
# and extra; some are GPL and AGPL, see docs/install.md).
#   docker build --target core -t damageest .
#   docker run --rm --user "$(id -u):$(id -g)" -v "$PWD:/data" damageest run /data/job.yaml
# BASE names a version of Debian, not its content, since the digest of an image can only be asked of a registry. To build from
# the same content each time: --build-arg BASE=debian@sha256:...
# Hosted CI builds both and runs the example job in each (.github/workflows/ci.yml); nothing else does.
ARG BASE=debian:trixie-slim

FROM ${BASE} AS base
RUN apt-get update \
 && apt-get install -y --no-install-recommends ca-certificates python3 \
 && rm -rf /var/lib/apt/lists/*

FROM base AS build
ARG UV=0.13.9
RUN apt-get update \
 && apt-get install -y --no-install-recommends python3-venv \
 && rm -rf /var/lib/apt/lists/*
RUN python3 -m venv /opt/uv && /opt/uv/bin/pip install --no-cache-dir uv==${UV}
ENV UV_PROJECT_ENVIRONMENT=/opt/damageest UV_PYTHON=/usr/bin/python3 UV_LINK_MODE=copy UV_NO_CACHE=1 UV_COMPILE_BYTECODE=1
WORKDIR /src
COPY . /src

FROM build AS build-core
RUN /opt/uv/bin/uv sync --no-dev --no-editable --extra report

FROM build AS build-all
# not the benchmarks, nor what only they need
RUN /opt/uv/bin/uv sync --no-dev --no-editable --all-packages --all-extras --no-install-package damageest-benchmarks \
      --no-install-package pycpd --no-install-package future

# HOME is writable for every user, so that `--user` may name one that the image does not know.
FROM base AS run
RUN useradd --uid 10001 --create-home --home-dir /home/damageest --shell /usr/sbin/nologin damageest \
 && chmod 1777 /home/damageest && mkdir /data && chown damageest /data
ENV HOME=/home/damageest PATH=/opt/damageest/bin:/usr/bin:/bin
WORKDIR /data
ENTRYPOINT ["damageest"]
CMD ["--help"]

FROM run AS all
RUN apt-get update \
 && apt-get install -y --no-install-recommends \
      libcom-err2 libegl1 libgl1 libgl1-mesa-dri libgmp10 libidn2-0 libopengl0 libudev1 libx11-6 \
 && rm -rf /var/lib/apt/lists/*
COPY --from=build-all /opt/damageest /opt/damageest
USER damageest

FROM run AS core
COPY --from=build-core /opt/damageest /opt/damageest
USER damageest
