# The library with the extra for films, in an image whose command is `wbc`:
#   docker build -t wbc . && docker run --rm wbc walk
FROM python:3.11-slim
# Pinocchio's wheel needs libgomp1; films need EGL.
RUN apt-get update && apt-get install -y --no-install-recommends libgomp1 libegl1 libgl1 && rm -rf /var/lib/apt/lists/*
WORKDIR /wbc
COPY pyproject.toml README.md LICENSE CHANGELOG.md ./
COPY wbc wbc
COPY robots robots
COPY feet feet
COPY tasks tasks
COPY sim sim
RUN pip install --no-cache-dir ".[film]"
ENV MUJOCO_GL=egl OMP_NUM_THREADS=1
WORKDIR /work
ENTRYPOINT ["wbc"]
CMD ["walk"]
