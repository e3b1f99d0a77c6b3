# One image for every process of ours, from the wheel of stilb-server; docker-compose.yml says which one a container runs.
# A tag may name another image tomorrow, a digest never does; docs/install.md has how to renew them.
ARG PYTHON=python:3.11-slim@sha256:9c900dea9e8fb7e16277c179b555cc72d29a352dbc33cff48ad5a0412fd5bfc7

FROM ${PYTHON} AS environment
WORKDIR /build
ENV PIP_DISABLE_PIP_VERSION_CHECK=1 UV_LINK_MODE=copy
COPY requirements-bootstrap.lock requirements.lock ./
RUN python -m venv /bootstrap \
 && /bootstrap/bin/pip install --no-cache-dir --require-hashes -r requirements-bootstrap.lock \
 && python -m venv --without-pip /environment \
 && /bootstrap/bin/uv pip install --no-cache --compile-bytecode --python /environment/bin/python --require-hashes -r requirements.lock
# NumPy's and SciPy's own tests, 49 MB: without this, the copy below would take them along.
RUN cd /environment/lib/python3.*/site-packages && find numpy scipy -type d -name tests -prune -exec rm -r {} +
COPY . .
# The root is read-only at run time, so the bytecode is written now.
RUN /bootstrap/bin/python .ci/server_wheel.py /dist \
 && /bootstrap/bin/uv pip install --no-cache --offline --no-deps --compile-bytecode --python /environment/bin/python /dist/*.whl

FROM ${PYTHON}
# The folder is made here so that a new volume mounted on it belongs to the unprivileged user.
RUN useradd --uid 10001 --no-create-home --shell /usr/sbin/nologin stilb \
 && install -d -o stilb -g stilb -m 700 /data
COPY --from=environment /environment /environment
# The bill of materials of its Python packages; those of Debian are in /var/lib/dpkg/status.
COPY --from=environment /dist/*.cdx.json /usr/share/doc/stilb-server/
ENV PATH=/environment/bin:$PATH PYTHONUNBUFFERED=1 PYTHONDONTWRITEBYTECODE=1 STILB_DATA=/data
USER stilb
VOLUME /data
EXPOSE 8000
CMD ["stilb-server", "service"]
