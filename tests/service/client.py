"""A client of a Halflight service that knows nothing of it but its address: messages and calls come from reflection.

    pip install grpcio grpcio-reflection googleapis-common-protos
    python3 client.py 127.0.0.1:7000 scene.glb

Submits the scene, watches its job, fetches the lit file, and checks errors and health on the way.
"""

import hashlib
import sys

import grpc
from google.protobuf import descriptor_pool, message_factory
from google.rpc import error_details_pb2, status_pb2
from grpc_reflection.v1alpha.proto_reflection_descriptor_database import ProtoReflectionDescriptorDatabase

SERVICE = "radiosity.v1.Radiosity"
CHUNK = 1 << 20


class Reflected:
    """The calls of a service, as it describes them itself."""

    def __init__(self, channel, name):
        pool = descriptor_pool.DescriptorPool(ProtoReflectionDescriptorDatabase(channel))
        self.pool, self.channel, self.name = pool, channel, name
        self.methods = pool.FindServiceByName(name).methods_by_name

    def message(self, name):
        return message_factory.GetMessageClass(self.pool.FindMessageTypeByName(name))

    def call(self, name, argument):
        method = self.methods[name]
        ways = {
            (False, False): self.channel.unary_unary,
            (False, True): self.channel.unary_stream,
            (True, False): self.channel.stream_unary,
        }
        reply = message_factory.GetMessageClass(method.output_type)
        way = ways[method.client_streaming, method.server_streaming]
        call = way(
            f"/{self.name}/{name}",
            request_serializer=lambda message: message.SerializeToString(),
            response_deserializer=reply.FromString,
        )
        return call(argument, timeout=90)


def details(error, kind):
    """The details of this kind of an error."""
    metadata = dict(error.trailing_metadata())
    status = status_pb2.Status.FromString(metadata["grpc-status-details-bin"])
    found = [detail for detail in status.details if detail.Is(kind.DESCRIPTOR)]
    assert found, status
    message = kind()
    found[0].Unpack(message)
    return message


def main(address, path):
    channel = grpc.insecure_channel(address)
    health = Reflected(channel, "grpc.health.v1.Health")
    asked = health.message("grpc.health.v1.HealthCheckRequest")(service=SERVICE)
    assert health.call("Check", asked).status == 1, "it does not serve"

    service = Reflected(channel, SERVICE)
    request = service.message("radiosity.v1.SubmitSceneRequest")
    with open(path, "rb") as file:
        scene = file.read()
    header = request()
    header.header.name = "from Python"
    header.header.file.sha256 = hashlib.sha256(scene).digest()
    header.header.file.size = len(scene)
    header.header.bake.error = 0.05

    try:
        # A scene that the service has need not be sent.
        job = service.call("SubmitScene", iter([header]))
    except grpc.RpcError as error:
        assert error.code() == grpc.StatusCode.FAILED_PRECONDITION, error
        assert details(error, error_details_pb2.PreconditionFailure).violations[0].type == "SCENE"
        chunks = [request(chunk=scene[at : at + CHUNK]) for at in range(0, len(scene), CHUNK)]
        job = service.call("SubmitScene", iter([header, *chunks]))
    for job in service.call("WatchJob", service.message("radiosity.v1.WatchJobRequest")(id=job.id)):
        print(job.state, job.progress.rows)
    assert job.state == 3, job.failure
    assert service.call("ListJobs", service.message("radiosity.v1.ListJobsRequest")()).jobs[0].id == job.id

    lit = b""
    for part in service.call("FetchResult", service.message("radiosity.v1.FetchResultRequest")(id=job.id)):
        lit += part.chunk
    assert hashlib.sha256(lit).digest() == job.outcome.sha256 and lit[:4] == b"glTF"

    header.header.bake.error = 7
    try:
        service.call("SubmitScene", iter([header]))
        raise AssertionError("an error of 700 % makes no sense")
    except grpc.RpcError as error:
        assert error.code() == grpc.StatusCode.INVALID_ARGUMENT, error
        assert details(error, error_details_pb2.BadRequest).field_violations[0].field == "bake.error"
    print("all is well")


if __name__ == "__main__":
    main(*sys.argv[1:])
