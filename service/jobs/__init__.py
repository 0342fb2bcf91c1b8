from service.jobs.endpoints import router

__all__ = ["router"]
