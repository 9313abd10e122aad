# gyrocal with the workbench, the networks and a C compiler, which the simulated device needs.
#
#     docker build --tag gyrocal .
#     docker run --rm gyrocal demo
#     docker run --rm -p 8750:8750 -v "$PWD:/data" gyrocal workbench --host 0.0.0.0 --http-port 8750 --no-browser
FROM python:3.12-slim
RUN apt-get update && apt-get install --yes --no-install-recommends gcc libc6-dev && rm -rf /var/lib/apt/lists/*
COPY pyproject.toml hatch_build.py constraints.txt README.md LICENSE /source/
COPY host /source/host
COPY model_export /source/model_export
COPY firmware /source/firmware
RUN pip install --no-cache-dir -c /source/constraints.txt '/source[page,net,import,ros]' && rm -r /source
RUN useradd --create-home user && mkdir /data && chown user /data
USER user
WORKDIR /data
ENTRYPOINT ["gyrocal"]
CMD ["--help"]
