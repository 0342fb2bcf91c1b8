# One image for API and workers; docker-compose.yml says which is which.
FROM python:3.12-slim AS build
RUN apt-get update && apt-get install -y --no-install-recommends g++
WORKDIR /src
COPY requirements.lock ./
RUN python -m venv /opt/gcvec && /opt/gcvec/bin/pip install --no-cache-dir -r requirements.lock
COPY . .
RUN /opt/gcvec/bin/pip install --no-cache-dir --no-deps .
# Kernels are compiled here, for any processor of this kind, and not in every container anew.
RUN cd / && /opt/gcvec/bin/python -m gcvec.kernel_library && find /opt/gcvec -name "*.nb[ic]" -delete

FROM python:3.12-slim
RUN useradd --create-home gcvec && mkdir /data && chown gcvec /data
COPY --from=build /opt/gcvec /opt/gcvec
USER gcvec
WORKDIR /home/gcvec
ENV PATH=/opt/gcvec/bin:$PATH PYTHONUNBUFFERED=1 NUMBA_CACHE_DIR=/tmp/numba GCVEC_DATA_DIR=/data
VOLUME /data
EXPOSE 8000
CMD ["gcvec", "serve", "--host", "0.0.0.0", "--data", "/data"]
