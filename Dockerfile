# One image for every process of ours; docker-compose.yml says which one a container runs.
FROM python:3.11-slim AS environment
WORKDIR /build
ENV PIP_DISABLE_PIP_VERSION_CHECK=1 UV_LINK_MODE=copy
COPY requirements-bootstrap.lock requirements.lock ./
RUN python -m venv /bootstrap \
 && /bootstrap/bin/pip install --no-cache-dir --require-hashes -r requirements-bootstrap.lock \
 && python -m venv --without-pip /environment \
 && /bootstrap/bin/uv pip install --no-cache --compile-bytecode --python /environment/bin/python --require-hashes -r requirements.lock

FROM python:3.11-slim
# The folder is made here so that a new volume mounted on it belongs to the unprivileged user.
RUN useradd --uid 10001 --no-create-home --shell /usr/sbin/nologin stilb \
 && install -d -o stilb -g stilb -m 700 /data
COPY --from=environment /environment /environment
WORKDIR /app
# The version of the product.
COPY pyproject.toml ./
COPY migrations migrations
COPY radiometry radiometry
COPY store store
COPY worker worker
COPY service service
# The service shows its page of errors.
COPY docs docs
# The root is read-only at run time, so the bytecode is written now.
RUN /environment/bin/python -m compileall -q .
ENV PATH=/environment/bin:$PATH PYTHONUNBUFFERED=1 PYTHONDONTWRITEBYTECODE=1 STILB_DATA=/data
USER stilb
VOLUME /data
EXPOSE 8000
CMD ["python", "-m", "service"]
